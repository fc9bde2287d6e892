"""Compiled code is kept where it can be; where it cannot be kept, commands work all the same and say so once."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from sources import SOURCES

import semrl

USE = """
import warnings
from semrl.core.errors import SemrlWarning
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    from semrl.perception.clustering.cf_kernels import compiled_sum
    from semrl.core import kernels
    @kernels.vectorised
    def twice(x):
        return x + x
    assert twice(3) == 6
for one in told:
    if one.category is SemrlWarning:
        print(one.message)
"""


@pytest.fixture
def locked_copy(tmp_path):
    """A copy of the package beside whose modules nothing can be written, whoever runs it."""
    source = shutil.copytree(
        Path(semrl.__file__).parent, tmp_path / "src" / "semrl", ignore=shutil.ignore_patterns("__pycache__")
    )
    for folder in [source, *(path for path in source.rglob("*") if path.is_dir())]:
        (folder / "__pycache__").write_text("no folder")
    return source.parent


@pytest.fixture
def use(tmp_path, locked_copy):
    def run(code=USE, argv=(), **environ):
        env = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "TMPDIR")}
        locked = {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null/cache", "OMP_NUM_THREADS": "1"}
        code_at = tmp_path / "use.py"
        code_at.write_text(code)
        done = subprocess.run(
            [sys.executable, code_at, *argv],
            capture_output=True,
            text=True,
            env={**env, **locked, "PYTHONPATH": str(locked_copy), "PYTHONDONTWRITEBYTECODE": "1", **environ},
            check=False,
        )
        assert "Traceback" not in done.stderr, done.stderr
        return done

    return run


def test_a_temporary_folder_is_used_and_told_once(use, tmp_path):
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    said = use(TMPDIR=str(temporary)).stdout
    (folder,) = temporary.glob("semrl-kernels-*")
    assert said.count("\n") == 1 and f"compiled code is kept in {folder}," in said
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    mine = USE.replace("def twice", "def thrice").replace("twice(3) == 6", "thrice(3) == 6")
    again = use(mine, NUMBA_CACHE_DIR=str(folder))
    assert again.returncode == 0 and again.stdout == ""  # where a folder was named, nothing is to be told


@pytest.mark.parametrize("occupied", ["a file", "a link", "open to others"])
def test_a_folder_that_may_be_somebody_elses_is_not_used(use, tmp_path, occupied):
    """Machine code that lies there is run."""
    temporary, user = tmp_path / "tmp", os.getuid()
    temporary.mkdir()
    place, other = temporary / f"semrl-kernels-{user}", tmp_path / "other"
    other.mkdir()
    if occupied == "a file":
        place.write_text("")
    elif occupied == "a link":
        place.symlink_to(other)
    else:
        place.mkdir()
        place.chmod(0o777)
    done = use(TMPDIR=str(temporary))
    assert done.returncode == 0 and done.stdout.count("\n") == 1
    assert "compiled code can be kept nowhere" in done.stdout
    assert not list(other.iterdir()) and (not place.is_dir() or not list(place.iterdir()))


def test_commands_work_and_say_so_in_one_line(use, tmp_path):
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    call = "import sys\nfrom semrl.cli import main\nsys.exit(main(sys.argv[1:]))"
    done = use(call, ("map", str(tmp_path / "none")), TMPDIR=str(temporary))
    assert done.returncode == 2 and [line[:15] for line in done.stderr.splitlines()] == [
        "semrl: warning:",
        "semrl: there is",
    ]
    done = use(call, ("doctor", "--json"), TMPDIR=str(temporary))
    assert done.returncode == 0 and done.stderr == ""


@pytest.mark.parametrize("file", SOURCES, ids=lambda path: path.name)
def test_everything_is_compiled_by_the_same_decorators(file):
    assert file.name == "kernels.py" or "njit" not in file.read_text()
