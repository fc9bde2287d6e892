"""The ledger of finished runs: a row for each in ``runs.csv``, its episodes in ``returns/ID.csv``.

What stands here is done, even when the folder of the run is gone.
"""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.errors import SemrlError
from semrl.experiments.sweep import RunSpec
from semrl.runs import RunFolder
from semrl.runs.files import write_text
from semrl.runs.metrics import RUNNING_MEAN_EPISODES, read_metrics


@dataclass(frozen=True, kw_only=True)
class Score:
    """A finished run, as a row of ``runs.csv``; numbers are None where no episode was finished or nothing planned.

    Attributes
    ----------
    id, preset, model, seed, frames
        See `RunSpec`.
    mean, max, min, std
        Returns of the last ten training episodes; the standard deviation is that of a sample, as the thesis's is.
    planner
        Mean return of the planner alone.
    seconds
        Wall-clock time of the training.
    versions, machine
        What it ran on.
    weights
        Digest of what was learned.
    """

    id: str
    preset: str
    model: str
    seed: int
    frames: int
    episodes: int
    mean: float | None
    max: float | None
    min: float | None
    std: float | None
    planner: float | None
    seconds: float
    versions: str
    machine: str
    weights: str


COLUMNS = tuple(field.name for field in fields(Score))


@dataclass(frozen=True, kw_only=True)
class Ledger:
    """All that is known of finished runs.

    Attributes
    ----------
    scores
        By id and budget in frames.
    returns
        By id and budget: ``(episodes, 2)``, decisions at the end of each training episode and its return.
    """

    scores: Mapping[tuple[str, int], Score]
    returns: Mapping[tuple[str, int], NDArray[np.float64]]

    def score(self, spec: RunSpec) -> Score | None:
        """Return what a run has scored; None while it is not finished."""
        return self.scores.get((spec.id, spec.frames))

    def last_returns(self, spec: RunSpec) -> NDArray[np.float64]:
        """Return the returns of the last episodes, ``(≤ 10,)``."""
        episodes = self.episodes(spec)
        return episodes[-RUNNING_MEAN_EPISODES:, 1]

    def episodes(self, spec: RunSpec) -> NDArray[np.float64]:
        """Return decisions and returns of all training episodes, ``(n, 2)``."""
        return self.returns.get((spec.id, spec.frames), np.zeros((0, 2)))


def read_ledger(folders: Iterable[Path]) -> Ledger:
    """Read the ledgers of some folders; of a run that stands in several, the first counts.

    Raises
    ------
    SemrlError
        When a file is damaged.
    """
    scores: dict[tuple[str, int], Score] = {}
    returns: dict[tuple[str, int], NDArray[np.float64]] = {}
    for folder in folders:
        for score in read_scores(folder / "runs.csv"):
            key = (score.id, score.frames)
            if key not in scores:
                scores[key] = score
                returns[key] = _read_returns(folder / "returns" / f"{score.id}.csv")
    return Ledger(scores=scores, returns=returns)


def read_scores(path: Path) -> list[Score]:
    """Read ``runs.csv``; nothing where there is none.

    Raises
    ------
    SemrlError
        When it is damaged.
    """
    if not path.exists():
        return []
    try:
        text = path.read_text()
        table = csv.DictReader(text.splitlines())
        if tuple(table.fieldnames or ()) != COLUMNS:
            raise ValueError(f"it does not have the columns {', '.join(COLUMNS)}")
        if not text.endswith("\n"):
            raise ValueError("its last line is not whole")
        return [_score(row) for row in table]
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise SemrlError(f"{path} is damaged: {error}") from None


def enter(folder: Path, score: Score, episodes: NDArray[np.float64]) -> None:
    """Write a finished run into the ledger of a folder; its row comes last, and says that all is there."""
    (folder / "returns").mkdir(exist_ok=True)
    lines = [f"{decisions:.0f},{total:g}\n" for decisions, total in episodes]
    write_text(folder / "returns" / f"{score.id}.csv", "decisions,return\n" + "".join(lines))
    kept = [other for other in read_scores(folder / "runs.csv") if other.id != score.id]
    write_text(folder / "runs.csv", _as_csv([*kept, score]))


def score_of(spec: RunSpec, run: Path, planner: float | None) -> tuple[Score, NDArray[np.float64]]:
    """Sum a finished run up: its row and its episodes."""
    manifest = RunFolder.open(run).manifest()
    rows = [row for row in read_metrics(run / "metrics.csv") if row["policy"] == "agent"]
    episodes = np.array([(float(row["decisions"]), float(row["return"])) for row in rows]).reshape(-1, 2)
    last = episodes[-RUNNING_MEAN_EPISODES:, 1]
    score = Score(
        id=spec.id,
        preset=spec.preset,
        model=spec.model,
        seed=spec.seed,
        frames=spec.frames,
        episodes=len(episodes),
        **summed_up(last),
        planner=planner,
        seconds=manifest["result"]["seconds"],
        versions=" ".join(f"{name}={value}" for name, value in manifest["versions"].items()),
        machine=" ".join(str(value) for value in manifest["machine"].values()),
        weights=manifest["hashes"]["weights"][:16],
    )
    return score, episodes


def summed_up(returns: NDArray[np.float64]) -> dict[str, float | None]:
    """Return mean, max, min and standard deviation of a sample, as Table 4.1 has them."""
    if not len(returns):
        return dict.fromkeys(("mean", "max", "min", "std"))
    std = float(returns.std(ddof=1)) if len(returns) > 1 else 0.0
    return {"mean": float(returns.mean()), "max": float(returns.max()), "min": float(returns.min()), "std": std}


def _score(row: Mapping[str, str]) -> Score:
    values: dict[str, Any] = dict(row)
    for name in ("seed", "frames", "episodes"):
        values[name] = int(row[name])
    for name in ("mean", "max", "min", "std", "planner"):
        values[name] = float(row[name]) if row[name] else None
    return Score(**values | {"seconds": float(row["seconds"])})


def _as_csv(scores: Sequence[Score]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(score) for score in scores)
    return text.getvalue()


def _read_returns(path: Path) -> NDArray[np.float64]:
    if not path.exists():
        return np.zeros((0, 2))
    try:
        return np.array([[float(cell) for cell in line.split(",")] for line in path.read_text().splitlines()[1:]]
                        ).reshape(-1, 2)  # fmt: skip
    except (OSError, ValueError) as error:
        raise SemrlError(f"{path} is damaged: {error}") from None
