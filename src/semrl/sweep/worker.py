"""One run of many, in a process of its own: ``python -m semrl.sweep.worker ID RUN CONFIG TRIALS``.

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
from semrl.sweep.task import Task
from semrl.sweep.trials import Trial
from semrl.training.config import from_dict, read_toml


def main(argv: Sequence[str]) -> int:
    """Do a task; its trials are a JSON list. Return the exit status."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    id_, run, config, trials = argv
    try:
        Task(
            id=id_,
            run=Path(run),
            config=from_dict(read_toml(Path(config)), source=config),
            trials=tuple(Trial(**trial) for trial in json.loads(trials)),
        ).work()
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
