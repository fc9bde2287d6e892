"""A pool of processes on this machine."""

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.sweep.engine import Ended
from semrl.sweep.task import Task
from semrl.training.config import write_toml

REPORTED = 1
"""Exit status of a worker that says why it failed, by itself or with a traceback; any other one means it is lost."""


@dataclass(frozen=True, kw_only=True)
class _Job:
    task: Task
    process: subprocess.Popen[bytes]
    said: IO[bytes]


class LocalPool:
    """Trains runs side by side, each in a process of its own that prints into ``RUN.log``.

    Parameters
    ----------
    workers
        How many at most.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._jobs: list[_Job] = []

    def has_room(self) -> bool:
        """Whether another task may be started."""
        return len(self._jobs) < self.workers

    def start(self, task: Task) -> None:
        """Start a process."""
        config = task.run.with_name(f"{task.run.name}.toml")
        write_text(config, write_toml(task.config))
        said = task.run.with_name(f"{task.run.name}.log").open("wb")
        trials = dumps([asdict(trial) for trial in task.trials])
        words = [sys.executable, "-m", "semrl.sweep.worker", task.id, str(task.run), str(config), trials]
        # A session of its own: Ctrl-C reaches us alone, and we ask the workers to save and stop.
        process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=said, stderr=said, start_new_session=True)
        self._jobs.append(_Job(task=task, process=process, said=said))

    def ended(self) -> Sequence[Ended]:
        """Return what is over since."""
        over = [job for job in self._jobs if job.process.poll() is not None]
        self._jobs = [job for job in self._jobs if job not in over]
        return [_closed(job) for job in over]

    def stop(self, *, now: bool = False) -> None:
        """Close what each worker listens to: no signal, which some systems do not let be handled."""
        for job in self._jobs:
            assert job.process.stdin is not None
            job.process.stdin.close()
            if now:
                job.process.kill()

    def close(self) -> None:
        """Wait until no worker is left."""
        for job in self._jobs:
            job.process.wait()
            job.said.close()
        self._jobs = []


def _closed(job: _Job) -> Ended:
    """Say how a process ended."""
    job.said.close()
    assert job.process.stdin is not None
    job.process.stdin.close()
    status = job.process.returncode
    if status == 0:
        return Ended(task=job.task, problem=None)
    lines = Path(job.said.name).read_text(encoding="utf-8", errors="replace").strip().splitlines()
    problem = lines[-1] if lines and status == REPORTED else f"exit status {status}"
    return Ended(task=job.task, problem=problem, lost=status != REPORTED)
