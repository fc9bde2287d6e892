"""Work beside the caller's, on a second processor where there is one; it changes when things are done, never what."""

import os
from collections.abc import Callable
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


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_workers: dict[int, ThreadPoolExecutor] = {}
"""Process → the one thread beside the caller's: a forked process has none of its parent's."""


def _worker() -> ThreadPoolExecutor | None:
    """Return the thread of this process; None where it would have to share a processor with the caller."""
    if processors() < 2:
        return None
    if os.getpid() not in _workers:
        _workers.clear()
        _workers[os.getpid()] = ThreadPoolExecutor(1, thread_name_prefix="semrl-beside")
    return _workers[os.getpid()]
