"""What a run left in its folder, read for the report; whatever is not there yet stays empty."""

import json
import shlex
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core.arrays import Arrays
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import read_arrays
from semrl.training.metrics import read_metrics

MAX_VIDEO_BYTES = 8_000_000
"""Longer videos stay beside the page instead of in it."""


@dataclass(frozen=True, kw_only=True)
class Series:
    """Numbers along the decisions of a run: ``x (n,)`` and ``y (n,)``, float64."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.x)


@dataclass(frozen=True, kw_only=True)
class RunRecord:
    """One run as its files describe it."""

    name: str
    """Of the folder."""
    path: str
    """Of the folder, as it was called; for the commands that the page proposes."""
    config: Mapping[str, Any]
    manifest: Mapping[str, Any]
    """Nested values of ``config.toml`` and ``manifest.json``."""
    rows: Sequence[Mapping[str, str]]
    """Of ``metrics.csv``: column → text."""
    evaluation: Mapping[str, Any] | None
    """Content of ``evaluation.json``; None when the run was not evaluated."""
    predictions: Mapping[str, Any] | None
    """Content of ``predictions.json``; None when it was not tested what the run predicts, or it cannot."""
    gallery: Arrays
    """Arrays of ``gallery.npz``; empty when there is none."""
    video: bytes | None
    """Bytes of ``video.mp4``; None when there is none or it is too large."""
    has_video: bool
    """Whether there is a ``video.mp4`` at all."""

    @property
    def frame_skip(self) -> int:
        """Emulator frames that one decision takes."""
        return int(self.config.get("environment", {}).get("frame_skip", 4))

    @property
    def decisions(self) -> int:
        """Decisions taken so far."""
        return int(self.rows[-1]["decisions"]) if not self._result else int(self._result["decisions"])

    @property
    def seconds(self) -> float:
        """Wall-clock time of the training so far."""
        return float(self.rows[-1]["seconds"]) if not self._result else float(self._result["seconds"])

    @property
    def began(self) -> bool:
        """Whether anything was measured."""
        return bool(self.rows) or bool(self._result)

    @property
    def _result(self) -> Mapping[str, Any]:
        return self.manifest.get("result") or {}

    def returns(self, policy: str = "agent") -> Series:
        """Return the return of each finished training episode that the agent, or the planner, played."""
        return _series([row for row in self.rows if row["policy"] == policy], "return", along="decisions")

    def column(self, phase: str, name: str) -> Series:
        """Return the numbers of one phase, by batches."""
        return _series([row for row in self.rows if row["phase"] == phase], name, along="batches")


def _series(rows: Sequence[Mapping[str, str]], name: str, *, along: str) -> Series:
    """Return the numbers of those rows where both cells are filled with finite ones."""
    pairs = [(float(row[along]), float(row[name])) for row in rows if row[along] and row[name]]
    values = np.array(pairs).reshape(-1, 2)  # (n, 2)
    values = values[np.isfinite(values).all(axis=1)]
    return Series(x=values[:, 0], y=values[:, 1])


def read_run(path: Path) -> RunRecord:
    """Read a run folder.

    Raises
    ------
    UsageError
        When it is none.
    SemrlError
        When one of its files is damaged.
    """
    try:
        config = tomllib.loads((path / "config.toml").read_text(encoding="utf-8"))
        manifest = json.loads((path / "manifest.json").read_text(encoding="utf-8"))
    except OSError:
        raise UsageError(f"{path} is not a run: config.toml or manifest.json is missing") from None
    except ValueError as error:
        raise SemrlError(f"{path} has a damaged config.toml or manifest.json: {error}") from None
    gallery, video = path / "gallery.npz", path / "video.mp4"
    embeddable = video.is_file() and video.stat().st_size < MAX_VIDEO_BYTES
    return RunRecord(
        name=path.resolve().name,
        path=str(path),
        config=config,
        manifest=manifest,
        rows=read_metrics(path / "metrics.csv"),
        evaluation=_read_json(path / "evaluation.json", ("mean", "std", "min", "max", "episodes"), "eval"),
        predictions=_read_json(path / "predictions.json", ("decisions", "balanced_accuracy"), "predict"),
        gallery=read_arrays(gallery) if gallery.exists() else {},
        video=video.read_bytes() if embeddable else None,
        has_video=video.is_file(),
    )


def _read_json(file: Path, numbers: Sequence[str], command: str) -> Mapping[str, Any] | None:
    """Return what a command left beside the run, which has at least these numbers; None where there is nothing."""
    if not file.exists():
        return None
    try:
        content: Mapping[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        for key in numbers:
            float(content[key])
    except (ValueError, KeyError, TypeError):
        again = f"semrl {command} {shlex.quote(str(file.parent))}"
        raise SemrlError(f"{file} is damaged; write it again with: {again}") from None
    return content
