"""What a run has learned, as a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semrl.core.arrays import Arrays, array_to_json, json_to_array
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import read_arrays, write_arrays

FORMAT = 2
"""Number of the layout of run folders; raised when older ones can no longer be read."""


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """The whole state of a run at one decision, and what belongs beside it."""

    arrays: Arrays
    metrics_rows: int
    seconds: float
    playable: frozenset[str]
    """Names of the arrays that are enough to play."""

    @property
    def file_name(self) -> str:
        """What its file is called: by its decisions, so that names sort as the training went."""
        return f"{int(self.arrays['decisions']):010d}.npz"


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write arrays and, as one more of them, what belongs beside them."""
    meta = {
        "format": FORMAT,
        "metrics_rows": checkpoint.metrics_rows,
        "seconds": checkpoint.seconds,
        "playable": sorted(checkpoint.playable),
    }
    write_arrays(path, {"meta": json_to_array(meta), **checkpoint.arrays})


def read_meta(path: Path) -> dict[str, Any]:
    """Read what belongs beside a checkpoint's arrays."""
    try:
        meta = array_to_json(read_arrays(path, prefixes=("meta",))["meta"])
        if meta["format"] != FORMAT:
            raise UsageError(f"{path} has format {meta['format']}; this semrl reads format {FORMAT}")
        return {name: meta[name] for name in ("metrics_rows", "seconds", "playable")}
    except (KeyError, TypeError, ValueError):
        raise SemrlError(f"{path} is no checkpoint: what it says of itself is missing") from None
