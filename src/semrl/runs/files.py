"""Writing files so that a power cut, a full disk or a kill never leaves half of one."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from semrl.arrays import Arrays
from semrl.errors import SemrlError


def write_atomic(path: Path, write: Callable[[IO[bytes]], Any]) -> None:
    """Write under a temporary name, sync, rename; the old file stays until the new one is whole.

    Raises
    ------
    SemrlError
        When it cannot be written (full disk, no permission).
    """
    temporary = path.with_name(path.name + ".tmp")
    try:
        with temporary.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise SemrlError(f"cannot write {path}: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Write text, whole or not at all."""
    write_atomic(path, lambda file: file.write(text.encode()))


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Write named arrays as an uncompressed ``.npz``, whole or not at all.

    The archive keeps a checksum of every array, so damage is found when it is read.
    """
    write_atomic(path, lambda file: np.savez(file, allow_pickle=False, **arrays))


def read_arrays(path: Path, *, prefixes: tuple[str, ...] = ("",)) -> Arrays:
    """Read what `write_arrays` wrote; only arrays whose names begin with one of the prefixes.

    Raises
    ------
    SemrlError
        When the file is missing or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files if name.startswith(prefixes)}
    except FileNotFoundError:
        raise SemrlError(f"{path} does not exist") from None
    except Exception as error:  # zipfile, zlib and numpy each have errors of their own for damage
        raise SemrlError(f"{path} is damaged ({type(error).__name__}: {error})") from None


def _sync_folder(folder: Path) -> None:
    """Make a rename last: on POSIX the folder has to be synced too."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
