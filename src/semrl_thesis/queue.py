"""Training runs, side by side in processes of their own; stopped at any moment, it goes on where it was."""

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType
from typing import IO

from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import locked, make_folder, write_text
from semrl.core.signals import handling
from semrl.core.strict_json import dumps
from semrl.training import RunFolder
from semrl.training.config import to_dict, write_toml
from semrl.training.progress_lines import EVERY_SECONDS
from semrl_thesis.ledger import Ledger, enter, score_of
from semrl_thesis.sweep import RunSpec

POLL_SECONDS = 0.2


@dataclass(frozen=True, kw_only=True)
class _Job:
    """A run that is being trained."""

    spec: RunSpec
    process: subprocess.Popen[bytes]
    said: IO[bytes]
    run: Path

    def last_line(self) -> str:
        """Return how far it is, as it says itself."""
        try:
            lines = RunFolder(self.run).log_path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        return lines[-1] if lines else "has not told yet how far it is"


class Queue:
    """Works off training runs and enters them into the ledger of a folder.

    Parameters
    ----------
    folder
        Gets ``runs/ID``, ``runs.csv``, ``trials.csv`` and ``returns/ID.csv``.
    workers
        How many runs are trained side by side.
    say
        Is told of every run that begins, ends or fails.

    Attributes
    ----------
    failed : dict of str to str
        Runs that failed, and why.
    """

    def __init__(self, folder: Path, *, workers: int, say: Callable[[str], None]) -> None:
        self.folder = folder
        self.workers = workers
        self.say = say
        self._jobs: list[_Job] = []
        self.failed: dict[str, str] = {}
        self._stops = 0
        self._told = time.monotonic()

    def run_all(self, specs: Sequence[RunSpec], ledger: Ledger) -> None:
        """Train what the ledger does not know yet, in this order.

        Raises
        ------
        UsageError
            When another process works here, or a run was begun with other settings; nothing is started then.
        SemrlError
            When it was stopped by SIGINT or SIGTERM.
        """
        waiting = [spec for spec in specs if not ledger.is_done(spec)]
        if not waiting:
            return
        make_folder(self.folder / "runs")
        for spec in waiting:
            _check_begun(self._run(spec), spec)
        with (
            locked(self.folder / "lock", f"{self.folder} is being worked on by another process"),
            handling(self._stop, signal.SIGINT, signal.SIGTERM),
            self._ending_all(),
        ):
            self._work(waiting)

    def _work(self, waiting: list[RunSpec]) -> None:
        total = len(waiting)
        while (waiting or self._jobs) and not self._stops:
            while waiting and len(self._jobs) < self.workers:
                spec = waiting.pop(0)
                if _is_done(self._run(spec), spec):  # only its entry in the ledger is missing
                    self._enter(spec)
                    continue
                self.say(f"run {total - len(waiting)} of {total}: {spec.id}, {spec.decisions:,} decisions")
                self._jobs.append(self._start(spec))
            time.sleep(POLL_SECONDS)
            self._tell_how_far()
            for job in [job for job in self._jobs if job.process.poll() is not None]:
                self._jobs.remove(job)
                self._close(job)
        if self._stops:
            raise SemrlError("stopped; the same command goes on where it was")

    def _tell_how_far(self) -> None:
        """Say every half minute how far the runs are."""
        if time.monotonic() - self._told >= EVERY_SECONDS:
            self._told = time.monotonic()
            for job in self._jobs:
                self.say(f"{job.spec.id}: {job.last_line()}")

    def _run(self, spec: RunSpec) -> Path:
        return self.folder / "runs" / spec.id

    def _start(self, spec: RunSpec) -> _Job:
        run = self._run(spec)
        config = run.with_name(f"{spec.id}.toml")
        write_text(config, write_toml(spec.config()))
        said = run.with_name(f"{spec.id}.log").open("wb")
        trials = dumps([asdict(trial) for trial in spec.trials])
        words = [sys.executable, "-m", "semrl_thesis.worker", str(run), str(config), trials]
        # A session of its own: Ctrl-C reaches us alone, and we ask the workers to save and stop.
        process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=said, stderr=said, start_new_session=True)
        return _Job(spec=spec, process=process, said=said, run=run)

    def _close(self, job: _Job) -> None:
        """Enter a run that is over, or note why it failed."""
        job.said.close()
        assert job.process.stdin is not None
        job.process.stdin.close()
        if job.process.returncode == 0:
            self._enter(job.spec)
            return
        lines = Path(job.said.name).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        self.failed[job.spec.id] = lines[-1] if lines else f"exit status {job.process.returncode}"
        self.say(f"{job.spec.id} failed: {self.failed[job.spec.id]}")

    def _enter(self, spec: RunSpec) -> None:
        """Enter a finished run into the ledger."""
        run = self._run(spec)
        score, episodes, outcomes = score_of(spec, run)
        enter(self.folder, score, episodes, outcomes)
        mean = "no episode finished" if score.mean is None else f"{score.mean:.1f} over the last episodes"
        self.say(f"{score.id} finished after {score.seconds / 60:.1f} minutes: {mean}")

    @contextlib.contextmanager
    def _ending_all(self) -> Iterator[None]:
        """Let no worker outlive the queue: ask each to save and stop, and wait."""
        try:
            yield
        finally:
            for job in self._jobs:  # not by a signal, which some systems do not let be handled
                assert job.process.stdin is not None
                job.process.stdin.close()
            for job in self._jobs:
                job.process.wait()
                job.said.close()

    def _stop(self, _number: int, _frame: FrameType | None) -> None:
        """Note the wish to stop; whoever wishes it twice does not wait for checkpoints."""
        self._stops += 1
        if self._stops > 1:
            for job in self._jobs:
                job.process.kill()


def _check_begun(run: Path, spec: RunSpec) -> None:
    """Check that a run that was begun is the one that is wanted.

    Raises
    ------
    UsageError
        When it is another one, or no run.
    """
    if run.exists() and to_dict(RunFolder.open(run).config()) != to_dict(spec.config()):
        raise UsageError(f"{run} was begun with other settings than {spec.id} has now; delete it to begin again")


def _is_done(run: Path, spec: RunSpec) -> bool:
    """Whether a run is trained and tested."""
    trained = run.exists() and RunFolder.open(run).manifest()["status"] == "finished"
    return trained and all(trial.was_held(run) for trial in spec.trials)
