"""Warnings of ours as one line each, on standard error."""

import contextlib
import warnings
from collections.abc import Iterator

from semrl.core.errors import SemrlWarning


@contextlib.contextmanager
def notes_in_one_line() -> Iterator[None]:
    """Print every `SemrlWarning` as one line; other warnings are shown as ever."""
    before = warnings.formatwarning

    def write(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
    ) -> str:
        if issubclass(category, SemrlWarning):
            return f"note: {' '.join(str(message).split())}\n"
        return before(message, category, filename, lineno, line)

    warnings.formatwarning = write
    try:
        yield
    finally:
        warnings.formatwarning = before
