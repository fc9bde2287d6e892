"""Running the documentation's pages as a reader does: their commands and their Python, in order, in one folder."""

import contextlib
import importlib.util
import io
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

from semrl.cli import main
from semrl.core import registry

FENCE = re.compile(r"^```(python|shell|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# ([\w/]+\.\w+)\n")


@dataclass(frozen=True)
class Block:
    """One fenced block of a page."""

    language: str
    text: str

    @property
    def file(self) -> str | None:
        """The file that the reader saves it as, which its first line names."""
        named = FILE.match(self.text)
        return named[1] if named else None


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page that a reader runs or saves; what is indented is only shown."""
    return [Block(language, text) for language, text in FENCE.findall(page.read_text(encoding="utf-8"))]


def run_page(page: Path, folder: Path) -> list[str]:
    """Run a page in the current folder; return what each block printed."""
    names: dict[str, object] = {"__name__": "__main__"}
    return [_run(block, names, folder) for block in blocks(page)]


def _run(block: Block, names: dict[str, object], folder: Path) -> str:
    if block.file:
        path = folder / block.file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text, encoding="utf-8")
        return block.file
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        if block.language == "shell":
            for words in _commands(block.text):
                _call(words, folder)
        elif not _lacks(block.text):
            exec(compile(block.text, "page", "exec"), names)
    return printed.getvalue()


def _commands(text: str) -> list[list[str]]:
    """Split a block into commands; one may go over several lines within quotes."""
    starts = re.split(r"^(?=semrl |pip )", text.replace("\\\n", " "), flags=re.MULTILINE)
    return [shlex.split(command, comments=True) for command in starts if command.strip()]


def _call(words: list[str], folder: Path) -> None:
    if words[0] == "semrl":
        assert main(words[1:]) == 0, words
        return
    assert words[:2] == ["pip", "install"], words
    target = str(folder / "site")
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--target", target]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, *words[2:]], check=True, capture_output=True)
    sys.path.insert(0, target)
    registry._added.cache_clear()
    assert entry_points(group="semrl.detectors")


def _lacks(text: str) -> bool:
    """Whether a block needs a package that is not installed."""
    needed = re.findall(r"^(?:from|import) (stable_baselines3)", text, re.MULTILINE)
    return any(importlib.util.find_spec(package) is None for package in needed)
