"""How inner loops are compiled, everywhere alike."""

import os
import stat
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from numba import config as numba_config
from numba import njit

from semrl.core.errors import SemrlWarning

Function = TypeVar("Function", bound=Callable[..., Any])


def compiler(**options: Any) -> Callable[[Function], Function]:
    """Return a decorator that compiles a function to machine code at its first call, and keeps that where it can.

    Machine code lies beside the module or in the user's cache. Where neither may be written to (an installation that is
    read-only, a user without a home), it is kept in a temporary folder of this user's, or not at all.

    Parameters
    ----------
    **options
        Of `numba.njit`.
    """

    def compile_(function: Function) -> Function:
        """Compile one function, elsewhere or without keeping it where it must be."""
        while True:
            try:
                done: Function = njit(cache=not _uncached, nogil=True, **options)(function)
            except RuntimeError as error:
                if _uncached or "cannot cache function" not in str(error):
                    raise
                _look_elsewhere()
            else:
                return done

    return compile_


_settings: Any = numba_config

_uncached: list[str] = []
"""Why nothing is kept, if so."""


def _look_elsewhere() -> None:
    """Let machine code be kept in a temporary folder; where that does not work either, keep none. Tell it once."""
    try:
        folder = _own_folder()
        if str(folder) == _settings.CACHE_DIR:
            raise OSError("it cannot be written to")  # it was tried
    except OSError as error:
        _uncached.append(str(error))
        warnings.warn(
            "compiled code can be kept nowhere, so each call compiles it again, for some ten seconds; "
            "NUMBA_CACHE_DIR may name a folder for it",
            SemrlWarning,
            stacklevel=3,
        )
        return
    _settings.CACHE_DIR = str(folder)
    os.environ["NUMBA_CACHE_DIR"] = str(folder)  # processes that we start need not look, or tell, again
    warnings.warn(
        f"compiled code is kept in {folder}, since neither {Path(__file__).parent} nor the user's cache "
        "can be written to; NUMBA_CACHE_DIR may name another folder",
        SemrlWarning,
        stacklevel=3,
    )


def _own_folder() -> Path:
    """Make a folder that nobody else can write to: what lies in it is run.

    Raises
    ------
    OSError
        When it cannot be made, or may be somebody else's.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir()) / f"semrl-kernels-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or (hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o077)):
        raise PermissionError(f"{folder} may be somebody else's")
    return folder


compiled = compiler()
"""Compile a function to machine code at its first call, and keep that for other processes."""

summing = compiler(fastmath={"reassoc", "contract"}, error_model="numpy")
"""Likewise where sums may be taken in any order, so that several are at once; what is not finite stays what it is."""

vectorised = compiler(error_model="numpy")
"""The same where numbers are divided by what is never 0: without a check of each, several are divided at once."""
