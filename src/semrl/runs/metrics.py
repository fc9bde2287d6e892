"""Metrics as CSV: one row for every batch of a stage and every episode."""

import csv
import io
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semrl.errors import SemrlError
from semrl.runs.files import write_text

COLUMNS = (
    "phase", "decisions", "frames", "batches", "stability", "leaves",
    "episode", "return", "length", "exploration", "loss", "updates", "seconds",
)  # fmt: skip
"""What a row may hold; cells that say nothing stay empty. ``seconds`` is wall-clock, everything else repeats."""


class MetricsFile:
    """``metrics.csv`` of a run, appended row by row.

    Parameters
    ----------
    path
        Of the file.
    n_rows
        Rows to keep of what is there: those that the checkpoint knew. Later ones will be written again.
    seconds
        Wall-clock time that the run has already taken.
    """

    def __init__(self, path: Path, *, n_rows: int = 0, seconds: float = 0.0) -> None:
        kept = read_metrics(path)[:n_rows] if n_rows else []
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(kept)
        write_text(path, text.getvalue())
        self.path = path
        self.n_rows = len(kept)
        self._began = time.monotonic() - seconds
        self._file = path.open("a", newline="")
        self._writer = csv.DictWriter(self._file, COLUMNS, lineterminator="\n")

    @property
    def seconds(self) -> float:
        """Wall-clock time of the run so far."""
        return time.monotonic() - self._began

    def write(self, row: Mapping[str, Any]) -> None:
        """Append one row."""
        self._writer.writerow({**row, "seconds": round(self.seconds, 3)})
        self.n_rows += 1

    def flush(self) -> None:
        """Hand everything to the operating system.

        Raises
        ------
        SemrlError
            When the disk is full.
        """
        try:
            self._file.flush()
        except OSError as error:
            raise SemrlError(f"cannot write {self.path}: {error.strerror}") from error

    def close(self) -> None:
        """Close the file."""
        self.flush()
        self._file.close()


def read_metrics(path: Path) -> list[dict[str, str]]:
    """Read all whole rows; a half-written last line is left out."""
    if not path.exists():
        return []
    lines = path.read_text().splitlines(keepends=True)
    return list(csv.DictReader(line for line in lines if line.endswith("\n")))
