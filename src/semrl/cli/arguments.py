"""Parsing with tyro, with errors of one line."""

import contextlib
import io
import re
from collections.abc import Sequence
from typing import TypeVar

import tyro

from semrl.errors import UsageError

Arguments = TypeVar("Arguments")


def parse(kind: type[Arguments], argv: Sequence[str], *, command: str, default: Arguments | None = None) -> Arguments:
    """Parse the arguments of one command into its dataclass, from a default instance if there is one.

    Raises
    ------
    UsageError
        When they are wrong; the message is one line.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                kind,
                args=list(argv),
                prog=f"semrl {command}",
                default=tyro.MISSING_NONPROP if default is None else default,
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff),
            )
    except SystemExit as leave:
        if leave.code in (0, None):
            raise
        raise UsageError(f"{_one_line(said.getvalue())}; see semrl {command} --help") from None


def _one_line(box: str) -> str:
    """Take the first sentence out of the box that tyro draws around its errors."""
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line).strip("╭╮╰╯│─ \t") for line in box.splitlines()]
    words = [
        line
        for line in lines
        if line and not re.fullmatch(r"(Parsing error|Unrecognized options|Required options)", line)
    ]
    return words[0].rstrip(".") if words else "wrong arguments"
