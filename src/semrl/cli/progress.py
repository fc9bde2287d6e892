"""What a person sees while something runs: on standard error, so that standard output stays clean."""

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Column
from rich.text import Text

if TYPE_CHECKING:  # importing them takes seconds, which commands that show a table should not cost
    from semrl.training.config import RunConfig
    from semrl.training.loop import Step
    from semrl.training.trainer import Row, Trainer


class _Printed(Console):
    """Standard output; when nobody reads it, the command ends."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


class _Told(Console):
    """Standard error; when nobody reads it, the command goes on."""

    def on_broken_pipe(self) -> None:
        self.quiet = True


console = _Printed()
error_console = _Told(stderr=True)


class _Rate(ProgressColumn):
    """Steps a second."""

    def render(self, task: Task) -> Text:
        """Show the rate of the last seconds."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:,.{0 if speed >= 10 else 1}f}/s", style="progress.data.speed")


def progress_bars() -> Progress:
    """Make bars with count, rate, time left and a note."""
    return Progress(
        TextColumn("{task.description:<10}"),
        BarColumn(bar_width=12),
        MofNCompleteColumn(table_column=_whole()),
        _Rate(table_column=_whole()),
        TimeRemainingColumn(compact=True, table_column=_whole()),
        TextColumn("{task.fields[note]}", table_column=Column(no_wrap=True, overflow="ellipsis")),
        console=error_console,
        speed_estimate_period=20,
    )


def _whole() -> Column:
    """Make a column that a narrow terminal does not cut."""
    return Column(no_wrap=True, min_width=1, overflow="fold")


def say(line: str) -> None:
    """Print a line on standard error, as it is; where it cannot be printed, work goes on."""
    with contextlib.suppress(OSError):
        error_console.print(line, soft_wrap=True, markup=False, highlight=False)


class TrainingProgress:
    """A bar for each phase of a training, or a line every half minute where there is no terminal; observes the trainer.

    Nothing is shown before the first decision: a call that cannot work costs one line, the error's.
    """

    def __init__(self, config: "RunConfig", path: Path) -> None:
        from semrl.training.progress_lines import TrainingLines

        self.config = config
        self.path = path
        self._bars = progress_bars()
        self._lines = None if error_console.is_terminal else TrainingLines(say)
        self._began = False
        self._tasks: dict[str, TaskID] = {}
        self._shown_at = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._lines:
            self._lines.close()
        elif self._began:
            self._bars.stop()

    def on_decision(self, trainer: "Trainer") -> None:
        """Move the agent's bar, a few times a second."""
        if self._lines:
            self._begin()
            self._lines.on_decision(trainer)
            return
        if trainer.perceiving or time.monotonic() - self._shown_at < 0.2 < trainer.decisions - trainer.decisions_:
            return
        self._shown_at = time.monotonic()
        task = self._task(trainer.phase, trainer.decisions, trainer.decisions_)
        self._bars.update(task, completed=trainer.decisions_)

    def on_row(self, row: "Row") -> None:
        """Note what was measured."""
        if self._lines:
            self._lines.on_row(row)
            return
        if "return" in row:  # the agent's
            note = f"return {row['return']:.0f}, episode {row['episode']}"
            self._bars.update(self._task(row["phase"], self.config.decisions, row["decisions"]), note=note)
            return
        # How long a stage takes is not known: its bar fills by the batches it has had.
        task = self._task(row["phase"], None, row["batches"] - 1)
        note = f"stability {row['stability']:.3f}" if "stability" in row else ""
        note += f", {row['clusters']} clusters" if "clusters" in row else ""
        self._bars.update(task, completed=row["batches"], note=note)

    def _task(self, phase: str, total: int | None, done: int) -> TaskID:
        self._begin()
        if phase not in self._tasks:
            for task in self._bars.tasks:  # the phases before it are complete
                self._bars.update(task.id, total=task.completed)
            self._tasks[phase] = self._bars.add_task(phase, total=total, completed=done, note="")
        return self._tasks[phase]

    def _begin(self) -> None:
        if self._began:
            return
        self._began = True
        say(f"{self.config.model} on {self.config.env}, seed {self.config.seed} → {self.path}")
        if not self._lines:
            self._bars.start()


class PlayProgress:
    """A bar, or a line every half minute where there is no terminal, while a trained run plays.

    Nothing is shown before the first decision: a call that cannot work costs one line, the error's.

    Parameters
    ----------
    what
        Is done.
    total, unit
        How much of it, and what that is.
    """

    def __init__(self, what: str, total: int, unit: str) -> None:
        from semrl.training.progress_lines import ProgressLines

        self._what, self._total, self._unit = what, total, unit
        self._bars = progress_bars()
        self._lines = None if error_console.is_terminal else ProgressLines(say)
        self._shown_at = 0.0
        self._counted = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._lines:
            self._lines.close()
        elif self._bars.tasks:
            self._bars.stop()

    def count(self, step: "Step") -> None:
        """Note one decision more, where decisions are what is counted; the beginning of an episode is none."""
        if step.action is not None:
            self._counted += 1
            self.update(self._counted, self._counted)

    def update(self, done: int, decisions: int, note: Callable[[], str] = str) -> None:
        """Note how far it is, a few times a second."""
        if self._lines:
            self._lines.update(self._what, done, self._total, unit=self._unit, decisions=decisions, note=note)
            return
        if time.monotonic() - self._shown_at < 0.2 and done < self._total:
            return
        self._shown_at = time.monotonic()
        if not self._bars.tasks:
            self._bars.start()
            self._bars.add_task(self._what, total=self._total, note="")
        self._bars.update(self._bars.task_ids[0], completed=done, note=note())


@contextlib.contextmanager
def working(text: str) -> Iterator[Callable[[str], None]]:
    """Show what is being done; yield what names the next thing. Without a terminal each is a line."""
    if not error_console.is_terminal:
        say(text)
        yield say
        return
    with error_console.status(text) as status:
        yield status.update


def show_summary(values: Mapping[str, object]) -> None:
    """Print names and values, each a line that is not wrapped: paths and commands are copied from it."""
    width = max(map(len, values))
    for name, value in values.items():
        line = Text.assemble((f"{name:<{width}}", "dim"), f"  {value}")
        console.print(line, soft_wrap=True, highlight=False)
