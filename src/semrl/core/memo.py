"""Remembering what a pure function returned, for many arguments at a time."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_ENTRIES = 1 << 15
"""Entries at which a memo is emptied; Pong needs about 3,000."""


class Memo:
    """What a function returned for rows of numbers, found again by their bits.

    A memo changes how long something takes and nothing else. When it is full it is emptied, which bounds its memory.

    Parameters
    ----------
    function
        Maps ``(k, width)`` to ``(k, ...)``, each row on its own.
    most_entries
        Entries at which it is emptied, `MOST_ENTRIES` if not given; one call with more keys than that is remembered.
    """

    def __init__(self, function: Callable[[NDArray[Any]], NDArray[Any]], most_entries: int | None = None) -> None:
        self.function = function
        self.most_entries = most_entries or MOST_ENTRIES
        self._values: dict[bytes, Any] = {}

    def __len__(self) -> int:
        return len(self._values)

    def clear(self) -> None:
        """Forget everything."""
        self._values.clear()

    def __call__(self, keys: NDArray[Any]) -> NDArray[Any]:
        """Return what the function says about ``(n, width)`` keys, ``(n, ...)``."""
        if not len(keys):
            return self.function(keys)
        if len(self) + len(keys) > self.most_entries:
            self.clear()
        bits, size = keys.tobytes(), keys.itemsize * keys.shape[1]
        names = [bits[i : i + size] for i in range(0, len(bits), size)]
        if new := {name: i for i, name in enumerate(names) if name not in self._values}:
            self._values.update(zip(new, self.function(keys[list(new.values())]), strict=True))
        return np.array([self._values[name] for name in names])
