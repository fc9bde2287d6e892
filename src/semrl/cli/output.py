"""Standard output and standard error as they may be: of any encoding, full, or with nobody to read them."""

import contextlib
import errno
import os
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from typing import TextIO

from semrl.core.errors import SemrlWarning

NOBODY_READS = 141
"""Exit status of a program that a shell ends because nobody reads its output."""

UNWRITABLE = (errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EBADF)
"""What goes wrong with a stream that is printed to: files that we write ourselves are named."""


@dataclass
class Ended:
    """How a command ended."""

    status: int = 0


@contextlib.contextmanager
def printing() -> Iterator[Ended]:
    """Print within a block whatever the streams are; what then cannot be printed decides the exit status.

    Characters that the encoding does not have are replaced, our warnings are lines, and an output that is full or has
    lost its reader ends the block without a traceback.
    """
    ended = Ended()
    before = [_replacing(stream) for stream in (sys.stdout, sys.stderr)]
    try:
        with warnings.catch_warnings():
            _print_warnings()
            yield ended
            if sys.stdout is not None and not sys.stdout.closed:
                sys.stdout.flush()
    except BrokenPipeError:
        ended.status = NOBODY_READS
    except OSError as error:
        what = error.filename or ("cannot write the output" if error.errno in UNWRITABLE else None)
        reason = error.strerror or error
        ended.status = complain(reason if what is None else f"{what}: {reason}", 1)
    finally:
        for stream, errors in zip((sys.stdout, sys.stderr), before, strict=True):
            _drain(stream)
            if isinstance(stream, TextIOWrapper) and errors:
                stream.reconfigure(errors=errors)


def complain(problem: object, status: int) -> int:
    """Say in one line what is wrong; return the exit status."""
    _say(f"semrl: {' '.join(str(problem).split())}")
    return status


def _say(line: str) -> None:
    with contextlib.suppress(OSError):  # nobody reads what goes wrong, or the disk that it goes to is full
        print(line, file=sys.stderr, flush=True)


def _print_warnings() -> None:
    """Print our warnings as one line each, others as ever."""
    warnings.simplefilter("always", SemrlWarning)
    others = warnings.showwarning

    def show(  # noqa: PLR0917 — as Python calls it
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        """Print one warning."""
        if issubclass(category, SemrlWarning):
            _say(f"semrl: warning: {' '.join(str(message).split())}")
        else:
            others(message, category, filename, lineno, file, line)

    warnings.showwarning = show


def _replacing(stream: TextIO | None) -> str | None:
    """Let a stream replace what its encoding does not have; return what it did before."""
    if not isinstance(stream, TextIOWrapper):
        return None
    before = stream.errors
    stream.reconfigure(errors="replace")
    return before


def _drain(stream: TextIO | None) -> None:
    """Let what a stream could not write go: the interpreter would try again at its end, and complain."""
    try:
        if stream is not None and not stream.closed:
            stream.flush()
    except OSError:
        assert stream is not None
        with contextlib.suppress(OSError):  # no descriptor of its own
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
            stream.flush()
