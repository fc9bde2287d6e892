"""One run of the queue, in a process of its own: ``python -m semrl.experiments.worker RUN CONFIG EPISODES``.

It goes on where the run stands, saves when it is told to stop, and stops when whoever started it is gone.
"""

import fcntl
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from semrl.errors import SemrlError
from semrl.runs import evaluate, train
from semrl.runs.config import from_dict, read_toml


def main(argv: Sequence[str]) -> int:
    """Train; where there is a map, let the planner play some episodes alone. Return the exit status."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    run, config, episodes = Path(argv[0]), Path(argv[1]), int(argv[2])
    try:
        if run.exists():
            _wait_for(run)
            train(run)
        else:
            train(run, from_dict(read_toml(config), source=str(config)))
        if episodes:
            evaluate(run, episodes=episodes, policy="planner")
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
