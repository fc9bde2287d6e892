"""Work beside the caller's, on a second processor where there is one; it changes when things are done, never what."""

import contextlib
import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Started(Generic[Result]):
    """A call that may have begun on another thread.

    Parameters
    ----------
    function
        Is called once, there or, when it has not begun by the time that its result is wanted, here. It must not start
        work of its own.
    """

    def __init__(self, function: Callable[[], Result]) -> None:
        self._function = function
        worker = _worker()
        self._future: Future[Result] | None = worker.submit(function) if worker else None

    def result(self) -> Result:
        """Return what the call returns, or raise what it raises; to be asked for once."""
        if self._future is None or self._future.cancel():
            return self._function()
        return self._future.result()


@contextlib.contextmanager
def in_turn(most_waiting: int) -> Iterator[Callable[[Callable[[], None]], None]]:
    """Give a function that takes calls, which are made on another thread in that order, and all by the block's end.

    It waits where so many calls wait, and raises what an earlier call raised; those after that one are made all the
    same.
    """
    waiting: deque[Future[None]] = deque()
    with ThreadPoolExecutor(1, thread_name_prefix="semrl-in-turn") as thread:

        def later(call: Callable[[], None]) -> None:
            waiting.append(thread.submit(call))
            while waiting and (len(waiting) > most_waiting or waiting[0].done()):
                waiting.popleft().result()

        yield later
        for call in waiting:
            call.result()


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Let this process work on one thread while the block lasts: other processes need the other processors."""
    global _is_alone  # noqa: PLW0603 - of the process
    before, _is_alone = _is_alone, True
    try:
        yield
    finally:
        _is_alone = before


_is_alone = False


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_workers: dict[int, ThreadPoolExecutor] = {}
"""Process → the one thread beside the caller's: a forked process has none of its parent's."""


def _worker() -> ThreadPoolExecutor | None:
    """Return the thread of this process; None where it would have to share a processor with the caller."""
    if _is_alone or processors() < 2:
        return None
    if os.getpid() not in _workers:
        _workers.clear()
        _workers[os.getpid()] = ThreadPoolExecutor(1, thread_name_prefix="semrl-beside")
    return _workers[os.getpid()]
