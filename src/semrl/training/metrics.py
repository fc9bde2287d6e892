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

COLUMNS = ("phase", "decisions", "seconds", "batches", "stability", "clusters", "episode", "policy", "return", "length")
"""The first columns; what else agents, map and world model measure stands behind them, as it comes.

Cells that say nothing stay empty. Seconds are wall-clock, everything else repeats."""


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
        self.path = path
        self.n_rows = len(kept)
        self._began = time.monotonic() - seconds
        self._open(tuple(kept[0]) if kept else COLUMNS, kept)

    @property
    def seconds(self) -> float:
        """Wall-clock time of the run so far."""
        return time.monotonic() - self._began

    def write(self, row: Mapping[str, Any]) -> None:
        """Append one row, at once: people watch the file grow. A column that is new is added to all rows.

        Raises
        ------
        SemrlError
            When the disk is full.
        """
        with self._as_semrl_error():
            if new := [column for column in row if column not in self._columns]:
                self._file.close()
                self._open((*self._columns, *new), read_metrics(self.path))
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
        with self._as_semrl_error():
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file, whatever becomes of rows that no checkpoint knows of."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _open(self, columns: tuple[str, ...], rows: list[dict[str, str]]) -> None:
        """Write the file anew with these columns and rows, and go on behind them."""
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_text(self.path, text.getvalue())
        self._columns = columns
        self._file = self.path.open("a", newline="", encoding="utf-8")
        self._writer = csv.DictWriter(self._file, columns, lineterminator="\n")

    @contextlib.contextmanager
    def _as_semrl_error(self) -> Iterator[None]:
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
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        rows = list(csv.DictReader(line for line in lines if line.endswith("\n")))
    except (ValueError, csv.Error) as error:
        raise SemrlError(f"{path} is damaged: {error}") from None
    uneven = any(None in row or None in row.values() for row in rows)  # more cells than columns, or fewer
    if uneven or any(tuple(row)[: len(COLUMNS)] != COLUMNS for row in rows):
        raise SemrlError(f"{path} is damaged: it does not begin with the columns {', '.join(COLUMNS)}")
    return rows


def running_mean(values: NDArray[np.float64], n: int = RUNNING_MEAN_EPISODES) -> NDArray[np.float64]:
    """Return the mean of each value and up to ``n − 1`` before it, ``(len(values),)``."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    ends = np.arange(1, len(values) + 1)
    starts = np.maximum(ends - n, 0)
    means: NDArray[np.float64] = (sums[ends] - sums[starts]) / (ends - starts)
    return means
