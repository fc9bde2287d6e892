"""How far something is, as a plain line every half minute: for logs, and where there is no terminal."""

import contextlib
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from semrl.training.trainer import AGENT, Row, Trainer

EVERY_SECONDS = 30.0
FEWEST_FOR_A_RATE = 10
"""Of fewer decisions no rate is written: what the first of a phase waited for says nothing of the others."""
RETURNS_SHOWN = 5


class ProgressLines:
    """Writes a line every half minute, and one where a part of the work ends.

    Parameters
    ----------
    write
        Gets each line.
    clock
        Returns seconds.
    """

    def __init__(self, write: Callable[[str], None], *, clock: Callable[[], float] = time.monotonic) -> None:
        self._write = write
        self._clock = clock
        self._what: str | None = None

    def update(
        self,
        what: str,
        done: int,
        total: int | None = None,
        *,
        unit: str = "decisions",
        decisions: int | None = None,
        note: Callable[[], str] = str,
    ) -> None:
        """Note how far it is; write when it is time.

        Parameters
        ----------
        what
            Is being done; another name ends what was done before.
        done, total, unit
            So many of how many, and what they are; without a total no time is left.
        decisions
            Taken so far, which the rate is of; `done` when None.
        note
            Says what else there is to say.
        """
        now, decisions = self._clock(), done if decisions is None else decisions
        if what != self._what:
            self.close()
            self._what = what
            self._first = self._printed = now, done, decisions
        self._now = now, done, decisions
        self._total, self._unit, self._note = total, unit, note
        if now - self._printed[0] >= EVERY_SECONDS:
            self._print()

    def close(self) -> None:
        """Write where it ended, unless that was said."""
        if self._what is not None and self._now != self._printed:
            self._print()
        self._what = None

    def _print(self) -> None:
        (now, done, decisions), (before, _, decisions_before) = self._now, self._printed
        self._printed = self._now
        of = "" if self._total is None else f" of {self._total:,}"
        parts = [f"{self._what}: {done:,}{of} {self._unit}"]
        if self._unit != "decisions":
            parts.append(f"{decisions:,} decisions")
        if now > before and decisions - decisions_before >= FEWEST_FOR_A_RATE:
            rate = (decisions - decisions_before) / (now - before)
            parts.append(f"{rate:,.{0 if rate >= 10 else 1}f}/s")
        left = self._left()
        note = self._note()
        self._write(", ".join([*parts, *([left] if left else [])]) + (f"; {note}" if note else ""))

    def _left(self) -> str:
        (now, done, decisions), (began, at_first, before) = self._now, self._first
        known = done > at_first and decisions - before >= FEWEST_FOR_A_RATE
        if self._total is None or not known or done >= self._total:
            return ""
        return f"{duration((self._total - done) * (now - began) / (done - at_first))} left"


class TrainingLines:
    """Progress lines of a training; observes the trainer."""

    def __init__(self, write: Callable[[str], None], *, clock: Callable[[], float] = time.monotonic) -> None:
        self._lines = ProgressLines(write, clock=clock)
        self._returns: deque[float] = deque(maxlen=RETURNS_SHOWN)
        self._batches = ""

    def on_decision(self, trainer: Trainer) -> None:
        """Note how far the phase is."""
        note = self._said_of_returns if trainer.phase == AGENT else lambda: self._batches
        self._lines.update(trainer.phase, trainer.decisions_, trainer.decisions, note=note)

    def on_row(self, row: Row) -> None:
        """Note what was measured."""
        if row["phase"] == AGENT:
            self._returns.append(row["return"])
            return
        stability = f", stability {row['stability']:.3f}" if "stability" in row else ""
        self._batches = f"batch {row['batches']:,}{stability}"

    def close(self) -> None:
        """Say where it ended."""
        self._lines.close()

    def _said_of_returns(self) -> str:
        return last_returns(self._returns)


def last_returns(returns: deque[float] | list[float]) -> str:
    """Tell the returns of the last few episodes, the newest last."""
    shown = list(returns)[-RETURNS_SHOWN:]
    return f"last returns {', '.join(f'{value:g}' for value in shown)}" if shown else "no episode finished yet"


def duration(seconds: float) -> str:
    """Tell a time as people read it: ``45 s``, ``12 min``, ``3 h 20 min``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


def append_line(path: Path, line: str) -> None:
    """Append a line, with the time, to a log; one that cannot be written ends no training."""
    with contextlib.suppress(OSError), path.open("a", encoding="utf-8") as file:
        file.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {line}\n")
