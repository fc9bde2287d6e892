"""Metrics as CSV: one row for every batch of a stage and every episode."""

import contextlib
import csv
import io
import os
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core.errors import SemrlError
from semrl.core.files import write_text

COLUMNS = (
    "phase", "decisions", "batches", "stability", "leaves",
    "episode", "policy", "return", "length", "exploration", "loss", "updates",
    "map_nodes", "map_edges", "seconds_map", "seconds_next_state", "seconds_reward", "seconds_routes", "seconds",
)  # fmt: skip
"""What a row may hold; cells that say nothing stay empty. Seconds are wall-clock, everything else repeats."""


RUNNING_MEAN_EPISODES = 10
"""Episodes that a learning curve is smoothed over, and that Table 4.1 sums up."""


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

    Raises
    ------
    SemrlError
        When fewer rows are there, or it cannot be written.
    """

    def __init__(self, path: Path, *, n_rows: int = 0, seconds: float = 0.0) -> None:
        kept = read_metrics(path)[:n_rows]
        if len(kept) < n_rows:
            raise SemrlError(f"{path} is damaged: it has {len(kept)} rows, where the checkpoint knows of {n_rows}")
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
        """Append one row, at once: people watch the file grow.

        Raises
        ------
        SemrlError
            When the disk is full.
        """
        with self._told():
            self._writer.writerow({**row, "seconds": round(self.seconds, 3)})
            self._file.flush()
        self.n_rows += 1

    def flush(self) -> None:
        """Make everything last, before a checkpoint says that it is there.

        Raises
        ------
        SemrlError
            When the disk is full.
        """
        with self._told():
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file, whatever becomes of rows that no checkpoint knows of."""
        with contextlib.suppress(OSError):
            self._file.close()

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise SemrlError(f"cannot write {self.path}: {error.strerror}") from error


def read_metrics(path: Path) -> list[dict[str, str]]:
    """Read all whole rows; a half-written last line is left out.

    Raises
    ------
    SemrlError
        When it is no table of numbers with our columns.
    """
    if not path.exists():
        return []
    try:
        lines = path.read_text().splitlines(keepends=True)
        rows = list(csv.DictReader(line for line in lines if line.endswith("\n")))
    except (ValueError, csv.Error) as error:
        raise SemrlError(f"{path} is damaged: {error}") from None
    if any(tuple(row) != COLUMNS or None in row.values() for row in rows):
        raise SemrlError(f"{path} is damaged: it does not have the columns {', '.join(COLUMNS)}")
    return rows


def running_mean(values: NDArray[np.float64], n: int = RUNNING_MEAN_EPISODES) -> NDArray[np.float64]:
    """Return the mean of each value and up to ``n − 1`` before it, ``(len(values),)``."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    ends = np.arange(1, len(values) + 1)
    starts = np.maximum(ends - n, 0)
    means: NDArray[np.float64] = (sums[ends] - sums[starts]) / (ends - starts)
    return means
