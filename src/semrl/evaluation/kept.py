"""Results that are kept in a run's folder, or printed all the same where nothing may be written to it."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semrl.core.errors import SemrlError, SemrlWarning, UsageError
from semrl.core.files import require_writable, write_text
from semrl.core.strict_json import dumps


def warn_unwritable(path: Path) -> None:
    """Warn before long work that its result will be printed, but cannot be kept."""
    try:
        require_writable(path)
    except UsageError as error:
        _warn(error)


def keep_result(path: Path, result: Mapping[str, Any], *, indent: int | None = None) -> None:
    """Write a result as JSON; where that fails, warn: who gets the result back still has it."""
    try:
        require_writable(path)
    except UsageError:
        return  # this was said before
    try:
        write_text(path, dumps(result, indent=indent) + "\n")
    except SemrlError as error:
        _warn(error)


def _warn(error: SemrlError) -> None:
    warnings.warn(f"{error}; the result is told, and not kept", SemrlWarning, stacklevel=4)
