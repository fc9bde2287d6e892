"""What a person sees while something runs: on standard error, so that standard output stays clean."""

import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
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
from rich.table import Column, Table
from rich.text import Text

from semrl.training import RunConfig
from semrl.training.trainer import AGENT, Row, Trainer

console = Console()
error_console = Console(stderr=True)


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


class TrainingProgress:
    """A bar for each phase of a training; observes the trainer.

    Nothing is shown before the first decision: a call that cannot work costs one line, the error's.
    """

    def __init__(self, config: RunConfig, path: Path) -> None:
        self.config = config
        self.path = path
        self._bars = progress_bars()
        self._tasks: dict[str, TaskID] = {}
        self._shown_at = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._tasks:
            self._bars.stop()

    def on_decision(self, trainer: Trainer) -> None:
        """Move the agent's bar, a few times a second."""
        if trainer.perceiving or time.monotonic() - self._shown_at < 0.2 < trainer.decisions - trainer.decisions_:
            return
        self._shown_at = time.monotonic()
        task = self._task(AGENT, trainer.decisions, trainer.decisions_)
        self._bars.update(task, completed=trainer.decisions_)

    def on_row(self, row: Row) -> None:
        """Note what was measured."""
        if row["phase"] == AGENT:
            note = f"return {row['return']:.0f}, episode {row['episode']}"
            self._bars.update(self._task(AGENT, self.config.decisions, row["decisions"]), note=note)
            return
        # How long a stage takes is not known: its bar fills by the batches it has had.
        task = self._task(row["phase"], None, row["batches"] - 1)
        note = f"stability {row['stability']:.3f}" if "stability" in row else ""
        note += f", {row['clusters']} clusters" if "clusters" in row else ""
        self._bars.update(task, completed=row["batches"], note=note)

    def _task(self, phase: str, total: int | None, done: int) -> TaskID:
        if not self._tasks:
            what = (
                f"[bold]{self.config.model}[/] on {self.config.env}, seed {self.config.seed} → {escape(str(self.path))}"
            )
            error_console.print(what, soft_wrap=True)
            self._bars.start()
        if phase not in self._tasks:
            for task in self._bars.tasks:  # the phases before it are complete
                self._bars.update(task.id, total=task.completed)
            self._tasks[phase] = self._bars.add_task(phase, total=total, completed=done, note="")
        return self._tasks[phase]


def summary(values: Mapping[str, object]) -> Table:
    """Make a table of names and values."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in values.items():
        table.add_row(f"[dim]{name}[/]", escape(str(value)))
    return table
