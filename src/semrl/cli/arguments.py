"""Parsing with tyro, with errors of one line."""

import contextlib
import difflib
import io
import itertools
import re
from collections.abc import Sequence
from typing import TypeVar

import tyro

from semrl.core.errors import UsageError

Arguments = TypeVar("Arguments")


def parse(kind: type[Arguments], argv: Sequence[str], *, command: str, default: Arguments | None = None) -> Arguments:
    """Parse the arguments of one command into its dataclass, from a default instance if there is one.

    Raises
    ------
    UsageError
        When they are wrong; the message is one line.
    SystemExit
        With 0, when help was asked for and shown.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                kind,
                args=list(argv),
                prog=f"semrl {command}",
                default=tyro.MISSING_NONPROP if default is None else default,
                config=(tyro.conf.HelptextFromCommentsOff,),
            )
    except SystemExit as leave:
        if leave.code in (0, None):
            raise
        raise UsageError(f"{_one_line(said.getvalue())}; see semrl {command} --help") from None


def _one_line(box: str) -> str:
    """Take what is wrong, and the closest option there is, out of the box that tyro draws around its errors."""
    plain = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in box.splitlines()]
    lines = [line.strip("│ \t") for line in plain if not line.startswith(("╭", "╰"))]
    is_rule = re.compile("[─-]{3,}").fullmatch
    framed = any(line.startswith("╭") for line in plain)
    if not framed and len(lines) > 1 and is_rule(lines[1]):
        lines = lines[2:]  # where there are no characters for frames, the title has a line of its own
    said = " ".join(itertools.takewhile(lambda line: not is_rule(line), lines)).rstrip(" .")
    unknown = re.findall(r"--[\w.-]+", said)[:1] if said.startswith("Unrecognized") else []
    options = re.findall(r"^--[\w.-]*\w", "\n".join(lines), re.MULTILINE)
    close = [match for word in unknown for match in difflib.get_close_matches(word, options, n=1)]
    return (said or "wrong arguments") + (f"; did you mean {close[0]}?" if close else "")
