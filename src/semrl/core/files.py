"""Writing files so that a power cut, a full disk or a kill never leaves half of one."""

import contextlib
import os
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from semrl.core.arrays import Arrays
from semrl.core.errors import SemrlError, UsageError


def write_atomic(path: Path, write: Callable[[IO[bytes]], Any]) -> None:
    """Write under a temporary name, sync, rename; the old file stays until the new one is whole.

    Raises
    ------
    SemrlError
        When it cannot be written (full disk, no permission).
    """
    temporary = temporary_name(path)
    try:
        with temporary.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise SemrlError(f"cannot write {path}: {error.strerror or error}") from error
    finally:  # whatever went wrong: of a whole file nothing is left under this name
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def temporary_name(path: Path) -> Path:
    """Return where this process writes a file before it is whole; another process that writes the same has its own."""
    return path.with_name(f"{path.name}.{os.getpid()}.tmp")


def require_writable(path: Path) -> None:
    """Check that a file may be written here, before work is done for it.

    Raises
    ------
    UsageError
        When it is a folder, or its folder is missing or locked.
    """
    if path.is_dir():
        raise UsageError(f"cannot write {path}: it is a folder")
    if not path.parent.is_dir():
        raise UsageError(f"cannot write {path}: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK):
        raise UsageError(f"cannot write {path}: nothing may be written to {path.parent}")


def make_folder(path: Path) -> None:
    """Make a folder, if it is not there, and those above it.

    Raises
    ------
    UsageError
        When it cannot be made, or nothing may be written to it.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot make the folder {path}: {error.strerror}") from None
    if not os.access(path, os.W_OK):
        raise UsageError(f"nothing may be written to {path}")


@contextlib.contextmanager
def locked(path: Path, busy: str) -> Iterator[None]:
    """Keep other processes out by a lock on a file; it ends with the process, however that ends.

    Raises
    ------
    UsageError
        With the message `busy`, when another process has the lock; or when nothing may be written there.
    """
    require_writable(path)
    lock = FileLock(path, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise UsageError(busy) from None
    try:
        yield
    finally:
        lock.release()


def wait_until_unlocked(path: Path) -> None:
    """Wait until no process has the lock of a file any more."""
    with FileLock(path):
        pass


def write_text(path: Path, text: str) -> None:
    """Write text, whole or not at all."""
    write_atomic(path, lambda file: file.write(text.encode(errors="replace")))  # names of files may be no text


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
        with zipfile.ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            return {name: _read_array(archive, name) for name in names if name.startswith(prefixes)}
    except FileNotFoundError:
        raise SemrlError(f"{path} does not exist") from None
    except Exception as error:  # zipfile, zlib and numpy each have errors of their own for damage
        raise SemrlError(f"{path} is damaged ({type(error).__name__}: {error})") from None


def _read_array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Read one array to its very end, where the checksum is compared; ``np.load`` may stop before."""
    with archive.open(f"{name}.npy") as file:
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        if file.read(1):
            raise ValueError(f"{name} is longer than it says")
    owner = array.base
    if not isinstance(owner, np.ndarray) or not array.flags.c_contiguous:
        return array
    shape = array.shape
    del array
    owner.resize(shape, refcheck=False)  # who takes over an array that owns its memory need not copy it
    return owner


def _sync_folder(folder: Path) -> None:
    """Make a rename last: on POSIX the folder has to be synced too."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except PermissionError:
        return  # Windows opens no folders, and needs no such thing
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
