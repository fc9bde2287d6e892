"""The command line in a process of its own, as a shell starts it."""

import os
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src"

BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
"""


def semrl(*argv, before="", python=(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, source=SOURCE, **environ):
    """Call the command line; `before` is run first. Return the finished process."""
    code = f"import sys\n{before}\nfrom semrl.cli import main\nsys.exit(main(sys.argv[1:]))"
    env = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "PYTHONUNBUFFERED")}
    return subprocess.run(
        [sys.executable, *python, "-c", code, *map(str, argv)],
        stdout=stdout,
        stderr=stderr,
        stdin=subprocess.DEVNULL,
        env={**env, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(source), **environ},
        check=False,
    )


def without(*names):
    """Return code after which modules of these names cannot be imported."""
    return BLOCKED.format(names=set(names))
