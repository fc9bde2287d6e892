"""A pool of machines: each run is a task of Ray (extra ``ray``)."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from semrl.core.errors import MissingExtraError, SemrlError, UsageError
from semrl.sweep.engine import Ended
from semrl.sweep.task import Task

STOP_SECONDS = 60.0
"""How long workers are waited for that were asked to save and stop."""


class RayPool:
    """Trains runs on the machines of a Ray cluster; each needs semrl and reaches the folders of the runs.

    Ray decides what runs where, a processor for each of `RunConfig.threads`. It is not asked to repeat what was lost:
    the queue starts it again, and it goes on from its newest checkpoint.

    Parameters
    ----------
    address
        Of the cluster, such as ``10.0.0.1:6379`` or ``auto``; one is begun on this machine when None.
    workers
        Processors of the one that is begun here.

    Raises
    ------
    MissingExtraError
        When Ray is not installed.
    UsageError
        When there is no such cluster.
    """

    def __init__(self, address: str | None = None, *, workers: int | None = None) -> None:
        try:
            import ray
        except ImportError:
            raise MissingExtraError("ray", "--engine ray") from None
        self._ray = ray
        own: dict[str, Any] = {} if address else {"num_cpus": workers, "include_dashboard": False}
        self._began = not ray.is_initialized()
        if self._began:
            try:
                ray.init(address=address or "local", logging_level=logging.ERROR, log_to_driver=False, **own)
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise UsageError(f"no Ray cluster answers at {address}: {str(error).splitlines()[0]}") from None
        self._work = ray.remote(max_calls=1, max_retries=0)(_work)
        self._tasks: dict[Any, Task] = {}

    def has_room(self) -> bool:
        """Say yes: Ray keeps what has no place yet."""
        return True

    def start(self, task: Task) -> None:
        """Hand a task to Ray."""
        sent = replace(task, run=task.run.resolve())
        self._tasks[self._work.options(num_cpus=task.config.threads, name=task.id).remote(sent)] = task

    def ended(self) -> Sequence[Ended]:
        """Return what is over since."""
        if not self._tasks:
            return []
        over, _ = self._ray.wait(list(self._tasks), num_returns=len(self._tasks), timeout=0)
        return [self._closed(reference, self._tasks.pop(reference)) for reference in over]

    def stop(self, *, now: bool = False) -> None:
        """Let Ray interrupt each worker, or kill it."""
        for reference in self._tasks:
            self._ray.cancel(reference, force=now)

    def close(self) -> None:
        """Wait until no worker is left, and end the cluster that was begun here."""
        if self._tasks:
            self._ray.wait(list(self._tasks), num_returns=len(self._tasks), timeout=STOP_SECONDS)
        self._tasks = {}
        if self._began:
            self._ray.shutdown()

    def _closed(self, reference: Any, task: Task) -> Ended:
        """Say how a task of Ray ended."""
        try:
            return Ended(task=task, problem=self._ray.get(reference))
        except self._ray.exceptions.RayTaskError as error:  # what it raised, with its traceback
            return Ended(task=task, problem=str(error).strip().splitlines()[-1])
        except self._ray.exceptions.RayError as error:  # worker or machine is gone
            return Ended(task=task, problem=type(error).__name__, lost=True)


def _work(task: Task) -> str | None:
    """Do a task where Ray wants it done; return what went wrong."""
    try:
        task.work()
    except SemrlError as error:
        return str(error)
    return None
