"""One run of many: what to train, how to test it, and doing so in this process."""

import json
import os
import platform
from dataclasses import dataclass
from pathlib import Path

from semrl.core.errors import UsageError
from semrl.core.files import wait_until_unlocked, write_text
from semrl.core.strict_json import dumps
from semrl.sweep.trials import Trial
from semrl.training import RunConfig, RunFolder, train
from semrl.training.config import to_dict


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run to be trained and tested."""

    id: str
    """What it is called."""
    run: Path
    """Its folder, in storage that every worker reaches."""
    config: RunConfig
    """Of the run."""
    trials: tuple[Trial, ...] = ()
    """How it is tested after training."""

    def work(self) -> None:
        """Train to the end of the budget, from the newest checkpoint where there is one, and hold the trials.

        Raises
        ------
        SemrlError
            When it fails, or is stopped by SIGINT or SIGTERM.
        """
        write_text(self.worker_path, dumps({"host": platform.node(), "pid": os.getpid()}))
        if self.run.exists():
            wait_until_unlocked(self.run / "lock")  # a worker that was given up may still be saving
            train(self.run)
        else:
            train(self.run, self.config)
        for trial in self.trials:
            if not trial.was_held(self.run):
                trial.hold(self.run)

    def is_done(self) -> bool:
        """Whether it is trained and tested."""
        trained = self.run.exists() and RunFolder.open(self.run).manifest()["status"] == "finished"
        return trained and all(trial.was_held(self.run) for trial in self.trials)

    def check_begun(self) -> None:
        """Check that a run that was begun is this one.

        Raises
        ------
        UsageError
            When it is another one, or no run.
        """
        if self.run.exists() and to_dict(RunFolder.open(self.run).config()) != to_dict(self.config):
            raise UsageError(
                f"{self.run} was begun with other settings than {self.id} has now; delete it to begin again"
            )

    @property
    def worker_path(self) -> Path:
        """Where a worker notes who it is."""
        return self.run.with_name(f"{self.run.name}.worker.json")

    def worker(self) -> str:
        """Return who works on it, ``HOST:PID``; empty while nobody does."""
        try:
            noted = json.loads(self.worker_path.read_text(encoding="utf-8"))
            return f"{noted['host']}:{noted['pid']}"
        except (OSError, ValueError, KeyError, TypeError):
            return ""

    def last_line(self) -> str:
        """Return how far it is, as it says itself."""
        try:
            lines = RunFolder(self.run).log_path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        return lines[-1] if lines else "has not reported yet how far it is"

    def reached(self) -> int:
        """Return the decisions of the newest checkpoint; 0 where there is none."""
        return max((int(path.stem) for path in RunFolder(self.run).checkpoints()), default=0)
