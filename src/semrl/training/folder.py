"""The folder of a run: configuration, manifest, metrics, checkpoints, results."""

import json
import os
import platform
import shlex
import shutil
import uuid
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import locked, make_folder, read_arrays, write_text
from semrl.core.strict_json import dumps
from semrl.training.checkpoint import FORMAT, Checkpoint, read_meta, write_checkpoint

if TYPE_CHECKING:
    from semrl.training.config import RunConfig

KEPT_CHECKPOINTS = 2
_PROVENANCE = ("semrl", "ale-py", "gymnasium", "numpy", "opencv-python-headless", "scikit-learn", "torch")


@dataclass(frozen=True)
class RunFolder:
    """Paths and files of one run."""

    path: Path

    @classmethod
    def create(cls, path: Path, config: "RunConfig") -> Self:
        """Make the folder, whole or not at all.

        Raises
        ------
        UsageError
            When there is something at this path already.
        """
        from semrl.training.config import write_toml

        if path.exists():
            further = f"go on with it ({cls(path).resuming}) or " if cls(path).resuming else ""
            raise UsageError(f"{path} exists: {further}choose another folder")
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        folder = cls(temporary)
        try:
            (temporary / "checkpoints").mkdir(parents=True)
            write_text(temporary / "config.toml", write_toml(config))
            folder.write_manifest(_provenance(config))
            temporary.rename(path)
        except OSError as error:
            raise UsageError(f"cannot make {path}: {error.strerror}") from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        return cls(path)

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Find an existing run.

        Raises
        ------
        UsageError
            When there is none, or it was left half-written, or is of another version.
        """
        path = Path(path)
        folder = cls(path)
        if not path.is_dir():
            raise UsageError(f"there is no run at {path}")
        if not (path / "config.toml").is_file() or not folder.manifest_path.is_file():
            raise UsageError(f"{path} is not a run, or only half of one: config.toml or manifest.json is missing")
        written = folder.manifest().get("format")
        if written != FORMAT:
            raise UsageError(f"{path} has format {written}; this semrl reads format {FORMAT}")
        return folder

    @property
    def manifest_path(self) -> Path:
        """Where the manifest is."""
        return self.path / "manifest.json"

    @property
    def metrics_path(self) -> Path:
        """Where the metrics are."""
        return self.path / "metrics.csv"

    @property
    def log_path(self) -> Path:
        """Where a plain line is written every half minute of training."""
        return self.path / "train.log"

    def config(self) -> "RunConfig":
        """Read the configuration."""
        from semrl.training.config import from_dict, read_toml  # late: it knows every part of a run, torch's among them

        path = self.path / "config.toml"
        return from_dict(read_toml(path), source=str(path))

    def manifest(self) -> dict[str, Any]:
        """Read the manifest: versions, machine, seed, status, hashes."""
        try:
            content = json.loads(self.manifest_path.read_text(encoding="utf-8"))
            if not isinstance(content, dict) or not {"format", "status"} <= content.keys():
                raise ValueError("it says nothing of format and status")
        except (OSError, ValueError) as error:
            raise UsageError(f"{self.manifest_path} is damaged: {error}") from None
        return content

    def write_manifest(self, content: dict[str, Any]) -> None:
        """Replace the manifest."""
        write_text(self.manifest_path, dumps(content, indent=2) + "\n")

    def update_manifest(self, **changes: Any) -> None:
        """Change some entries of the manifest."""
        self.write_manifest(self.manifest() | changes)

    @property
    def base_iri(self) -> str:
        """What the IRIs of all that this run has learned begin with: stable, and no other run's.

        A run is given an id when it is made, which moves and copies keep. One that is older than ids is known by its
        configuration and by what it has learned.

        Raises
        ------
        UsageError
            When the manifest is damaged.
        """
        manifest = self.manifest()
        if "id" not in manifest:
            learned = dumps(manifest.get("hashes", {}), sort_keys=True)
            known = uuid.uuid5(uuid.NAMESPACE_OID, (self.path / "config.toml").read_text(encoding="utf-8") + learned)
            return f"urn:uuid:{known}#"
        try:
            return f"urn:uuid:{uuid.UUID(manifest['id'])}#"
        except (ValueError, AttributeError, TypeError):
            raise UsageError(f"{self.manifest_path} is damaged: its id is no UUID") from None

    @property
    def resuming(self) -> str:
        """The command that goes on with the run, as a shell takes it; empty where its world does not repeat itself."""
        try:
            repeats = self.manifest().get("environment", {}).get("repeats", True)
        except (UsageError, AttributeError):  # damaged: an error for whoever goes on with it
            repeats = True
        return f"semrl train --run {shlex.quote(str(self.path))} --resume" if repeats else ""

    def checkpoints(self) -> list[Path]:
        """Return the checkpoints, oldest first."""
        return sorted((self.path / "checkpoints").glob("*.npz"))

    def save(self, checkpoint: Checkpoint, *, keep: int = KEPT_CHECKPOINTS) -> Path:
        """Write a checkpoint, then remove the ones before the last few."""
        path = self.path / "checkpoints" / checkpoint.file_name
        write_checkpoint(path, checkpoint)
        for old in self.checkpoints()[:-keep]:
            old.unlink()
        return path

    def milestones(self) -> dict[int, Path]:
        """Return what is kept of the way, by decisions."""
        kept = sorted((self.path / "milestones").glob("*.npz"))
        return {int(path.stem): path for path in kept if path.stem.isdecimal()}

    def save_milestone(self, checkpoint: Checkpoint) -> None:
        """Keep what is needed to play, for good."""
        make_folder(self.path / "milestones")
        write_checkpoint(self.path / "milestones" / checkpoint.file_name, checkpoint)

    def load(
        self, at: int | None = None, *, prefix: str = "", play_only: bool = False, memory: bool = False
    ) -> Checkpoint | None:
        """Read the newest checkpoint or a milestone; or, of it, only arrays whose names begin with `prefix`.

        With `play_only`, read what is needed to play; with `memory` also what map and world model need to go on
        learning. None when there is no checkpoint yet.

        Raises
        ------
        UsageError
            When there is no such milestone.
        SemrlError
            When it is damaged; the message says how to go back to the one before.
        """
        paths = self.checkpoints() if at is None else [self._milestone(at)]
        if not paths:
            return None
        try:
            meta = read_meta(paths[-1])
            wanted = (*meta["playable"], *(("planning/",) if memory else ())) if play_only else (prefix,)
            arrays = read_arrays(paths[-1], prefixes=wanted)
            arrays.pop("meta", None)
        except UsageError:
            raise
        except SemrlError as error:
            before = f"to go on from {paths[-2].name}" if len(paths) > 1 else "to start again"
            advice = f"delete this file {before}" if at is None else "ask for another milestone"
            raise SemrlError(f"{error}; {advice}") from None
        return Checkpoint(
            arrays=arrays,
            metrics_rows=meta["metrics_rows"],
            seconds=meta["seconds"],
            playable=frozenset(meta["playable"]),
        )

    def newest(
        self, at: int | None = None, *, prefix: str = "", play_only: bool = False, memory: bool = False
    ) -> Checkpoint:
        """Read as `load` does, where something must be there.

        Raises
        ------
        UsageError
            When there is no checkpoint yet, or no such milestone.
        SemrlError
            When it is damaged.
        """
        checkpoint = self.load(at, prefix=prefix, play_only=play_only, memory=memory)
        if checkpoint is None:
            raise UsageError(f"{self.path} has no checkpoint yet; go on with: {self.resuming}")
        return checkpoint

    def _milestone(self, at: int) -> Path:
        kept = self.milestones()
        if at not in kept:
            there = f"those of decisions {', '.join(map(str, kept))}" if kept else "none"
            raise UsageError(f"{self.path} has no milestone of decision {at}, there are {there}")
        return kept[at]

    def locked(self) -> AbstractContextManager[None]:
        """Keep other processes from training the same run.

        Raises
        ------
        UsageError
            On entering, when another process has it.
        """
        return locked(self.path / "lock", f"{self.path} is being trained by another process")

    def clean(self) -> None:
        """Remove what an interrupted training left behind; what others write into the folder meanwhile is theirs."""
        for left in [
            *self.path.glob("metrics.csv*.tmp"),
            *self.path.glob("manifest.json*.tmp"),
            *self.path.glob("checkpoints/*.tmp"),
            *self.path.glob("milestones/*.tmp"),
        ]:
            left.unlink()


def _provenance(config: "RunConfig") -> dict[str, Any]:
    return {
        "format": FORMAT,
        "id": str(uuid.uuid4()),
        "status": "new",
        "model": config.model,
        "env": config.env,
        "seed": config.seed,
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in _PROVENANCE}},
        "machine": {"system": platform.system(), "processor": platform.machine(), "cores": os.cpu_count()},
        "threads": config.threads,
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
