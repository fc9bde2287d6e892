"""Locks between processes, on every system."""

import ast
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from semrl.core import files
from semrl.core.errors import UsageError
from semrl.core.files import locked, wait_until_unlocked, write_text

SOURCES = sorted((Path(__file__).parents[2] / "src").rglob("*.py"))
POSIX_ONLY = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}

HOLD = """
import sys
from pathlib import Path
from semrl.core.files import locked
with locked(Path(sys.argv[1]), "busy"):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Another process, which has the lock until its input ends."""
    words = [sys.executable, "-c", HOLD, str(tmp_path / "lock")]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_what_another_process_has_locked_is_refused_and_free_when_it_ended(tmp_path, holder):
    with pytest.raises(UsageError, match=r"^busy here$"), locked(tmp_path / "lock", "busy here"):
        pass
    holder.kill()
    holder.wait()
    with locked(tmp_path / "lock", "busy here"):
        pass


def test_who_waits_goes_on_when_the_lock_is_free_and_not_before(tmp_path, holder):
    waiting = threading.Thread(target=wait_until_unlocked, args=[tmp_path / "lock"])
    waiting.start()
    waiting.join(0.3)
    assert waiting.is_alive()
    holder.communicate("")
    waiting.join(60)
    assert not waiting.is_alive()


def test_a_lock_is_let_go_when_the_work_fails(tmp_path):
    with pytest.raises(ZeroDivisionError), locked(tmp_path / "lock", ""):
        1 / 0  # noqa: B018
    with locked(tmp_path / "lock", ""):
        pass


def test_files_are_written_where_folders_cannot_be_opened(tmp_path, monkeypatch):
    """As on Windows."""

    def refuse(path, _flags):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(files.os, "open", refuse)
    write_text(tmp_path / "file", "whole")
    assert (tmp_path / "file").read_text() == "whole"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_no_module_needs_posix_to_be_imported(path):
    """What one system lacks may be asked for where it is used, not at the head of a module."""
    names = {
        name.partition(".")[0]
        for node in ast.parse(path.read_text()).body
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert not names & POSIX_ONLY
