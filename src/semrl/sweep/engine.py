"""Working off many runs, whatever they run on; stopped at any moment, the same call goes on where they were."""

import contextlib
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Literal, Protocol

from semrl.core.errors import SemrlError
from semrl.core.files import locked, make_folder
from semrl.core.signals import handling
from semrl.sweep.task import Task
from semrl.training.progress_lines import EVERY_SECONDS

POLL_SECONDS = 0.2

LOSSES = 5
"""Workers that a run may lose one after the other, with no new checkpoint between them, before it has failed."""


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How a pool's work on a task ended."""

    task: Task
    """Which."""
    problem: str | None
    """What went wrong; None when it is done."""
    lost: bool = False
    """Whether its worker or machine is gone, so that another one can go on."""


class Pool(Protocol):
    """Where tasks run."""

    def has_room(self) -> bool:
        """Whether another task may be started."""

    def start(self, task: Task) -> None:
        """Let a worker do `Task.work`."""

    def ended(self) -> Sequence[Ended]:
        """Return the tasks that ended since this was asked before."""

    def stop(self, *, now: bool = False) -> None:
        """Ask every worker to save and stop, or end it at once; may be asked again."""

    def close(self) -> None:
        """Wait until no worker is left."""


@dataclass
class TaskState:
    """How a task stands: its status, why it failed, and the workers that it lost at one checkpoint."""

    task: Task
    status: Literal["waiting", "running", "finished", "failed"] = "waiting"
    problem: str = ""
    losses: int = 0
    reached: int = 0


def run_all(
    tasks: Sequence[Task],
    pool: Pool,
    folder: Path,
    *,
    say: Callable[[str], None] = lambda _: None,
    show: Callable[[Sequence[TaskState]], None] | None = None,
    on_finished: Callable[[Task], None] = lambda _: None,
) -> list[TaskState]:
    """Train and test runs that are not done yet, in this order; those that lose their worker go on elsewhere.

    Parameters
    ----------
    tasks
        The runs; their folders are made.
    pool
        Where they run.
    folder
        Only one process at a time may work here.
    say
        Called with a line when a run begins, ends or fails, and every half minute on how far they are, unless they are
        shown.
    show
        Is given the state of all, some times a second.
    on_finished
        Is given each task that is done, also one that was so already.

    Returns
    -------
    list of TaskState
        In the order of the tasks; every one is finished or failed.

    Raises
    ------
    UsageError
        When another process works here, or a run was begun with other settings; nothing is started then.
    SemrlError
        When it was stopped by SIGINT or SIGTERM.
    """
    make_folder(folder)
    for task in tasks:
        make_folder(task.run.parent)
        task.check_begun()
    queue = _Queue(tasks, pool, say=say, show=show, on_finished=on_finished)
    with (
        locked(folder / "lock", f"{folder} is being worked on by another process"),
        handling(queue.stop, signal.SIGINT, signal.SIGTERM),
        _ending(pool),
    ):
        queue.work()
    return queue.states


class _Queue:
    """The tasks of one call, and how they stand."""

    def __init__(
        self,
        tasks: Sequence[Task],
        pool: Pool,
        *,
        say: Callable[[str], None],
        show: Callable[[Sequence[TaskState]], None] | None,
        on_finished: Callable[[Task], None],
    ) -> None:
        self.states = [TaskState(task) for task in tasks]
        self._pool = pool
        self._say = say
        self._show = show
        self._on_finished = on_finished
        self._waiting = list(self.states)
        self._stops = 0
        self._printed = time.monotonic()

    def work(self) -> None:
        """Work all off."""
        while not self._stops and any(state.status in ("waiting", "running") for state in self.states):
            while self._waiting and self._pool.has_room():
                self._start(self._waiting.pop(0))
            time.sleep(POLL_SECONDS)
            self._print()
            for ended in self._pool.ended():
                self._close(next(state for state in self.states if state.task is ended.task), ended)
        if self._show:
            self._show(self.states)
        if self._stops:
            raise SemrlError("stopped; the same command goes on where it was")

    def stop(self, _number: int, _frame: FrameType | None) -> None:
        """Note the wish to stop; whoever wishes it twice does not wait for checkpoints."""
        self._stops += 1
        if self._stops > 1:
            self._pool.stop(now=True)

    def _start(self, state: TaskState) -> None:
        if state.task.is_done():
            self._finish(state)
            return
        place = f"{self.states.index(state) + 1} of {len(self.states)}"
        again = f", from decision {state.task.reached():,}" if state.losses else ""
        self._say(f"run {place}: {state.task.id}, {state.task.config.decisions:,} decisions{again}")
        state.task.worker_path.unlink(missing_ok=True)
        state.status = "running"
        self._pool.start(state.task)

    def _close(self, state: TaskState, ended: Ended) -> None:
        """Note how a task ended; who only lost its worker waits for another one, before all others."""
        if ended.problem is None:
            self._finish(state)
            return
        if ended.lost:
            reached = state.task.reached()
            state.losses = 1 if reached > state.reached else state.losses + 1
            state.reached = reached
            if state.losses <= LOSSES:
                self._say(f"{state.task.id} lost its worker: {ended.problem}; another one goes on")
                state.status = "waiting"
                self._waiting.insert(0, state)
                return
        state.status, state.problem = "failed", ended.problem
        self._say(f"{state.task.id} failed: {ended.problem}")

    def _finish(self, state: TaskState) -> None:
        state.status = "finished"
        self._on_finished(state.task)

    def _print(self) -> None:
        """Show how all stand, or say every half minute how far the running ones are."""
        if self._show:
            self._show(self.states)
        elif time.monotonic() - self._printed >= EVERY_SECONDS:
            self._printed = time.monotonic()
            for state in self.states:
                if state.status == "running":
                    self._say(f"{state.task.id}: {state.task.last_line()}")


@contextlib.contextmanager
def _ending(pool: Pool) -> Iterator[None]:
    """Let no worker outlive the queue: ask each to save and stop, and wait."""
    try:
        yield
    finally:
        pool.stop()
        pool.close()
