"""One run of the queue, in a process of its own: ``python -m semrl_thesis.worker RUN CONFIG TRIALS``.

It goes on where the run stands, saves when it is told to stop, and stops when whoever started it is gone.
"""

import fcntl
import json
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from semrl.core.errors import SemrlError
from semrl.training import train
from semrl.training.config import from_dict, read_toml
from semrl_thesis.trials import Trial


def main(argv: Sequence[str]) -> int:
    """Train, then hold the trials, a JSON list, that were not held yet. Return the exit status."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    run, config, trials = Path(argv[0]), Path(argv[1]), [Trial(**trial) for trial in json.loads(argv[2])]
    try:
        if run.exists():
            _wait_for(run)
            train(run)
        else:
            train(run, from_dict(read_toml(config), source=str(config)))
        for trial in trials:
            if not trial.was_held(run):
                trial.hold(run)
    except SemrlError as error:
        print(f"{error}", file=sys.stderr)
        return 1
    return 0


def _wait_for(run: Path) -> None:
    """Wait until a worker whose queue was killed has saved and let go of its run."""
    with (run / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)


def _end_with_parent() -> None:
    """Stop as by SIGTERM when standard input ends: it is a pipe from the parent, which closes however that one ends."""
    while os.read(0, 1024):  # unbuffered: a lock that is held at exit would be fatal
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
