"""One run of the queue, in a process of its own: ``python -m semrl_thesis.worker RUN CONFIG TRIALS``.

It goes on where the run stands, saves when it is told to stop, and stops when whoever started it is gone.
"""

import json
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from semrl.core.errors import SemrlError
from semrl.core.files import wait_until_unlocked
from semrl.training import train
from semrl.training.config import from_dict, read_toml
from semrl_thesis.trials import Trial


def main(argv: Sequence[str]) -> int:
    """Train, then hold the trials, a JSON list, that were not held yet. Return the exit status."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    run, config, trials = Path(argv[0]), Path(argv[1]), [Trial(**trial) for trial in json.loads(argv[2])]
    try:
        if run.exists():
            wait_until_unlocked(run / "lock")  # a worker whose queue was killed saves before it lets go
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


def _end_with_parent() -> None:
    """Stop as by SIGTERM when standard input ends: it is a pipe from the parent, which closes however that one ends."""
    while os.read(0, 1024):  # unbuffered: a lock that is held at exit would be fatal
        pass
    signal.raise_signal(signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
