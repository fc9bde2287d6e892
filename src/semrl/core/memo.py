"""Remembering what a pure function returned, for many arguments at a time and without a loop in Python."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core.kernels import compiled

MOST_ENTRIES = 1 << 15
"""Entries at which a memo is emptied; Pong needs about 3,000."""

_FREE = -1


class Memo:
    """What a function returned for rows of integers, found again by these rows.

    Keys are compared in full, so a memo changes how long something takes and nothing else. When it is full it is
    emptied, which bounds its memory.

    Parameters
    ----------
    function
        Maps ``(k, width)`` of `dtype` to ``(k, ...)``, each row on its own.
    width
        Integers in one key.
    dtype
        Of the keys, an integer.
    most_entries
        Entries at which it is emptied, `MOST_ENTRIES` if not given; one call with more keys than that makes it larger.
    """

    def __init__(
        self,
        function: Callable[[NDArray[Any]], NDArray[Any]],
        width: int,
        dtype: type[np.integer[Any]] = np.int64,
        most_entries: int | None = None,
    ) -> None:
        self.function = function
        self._keys = np.zeros((most_entries or MOST_ENTRIES, width), dtype)
        self._values: NDArray[Any] | None = None  # (most_entries, ...), once it is known what they are
        self.clear()

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        """Forget everything."""
        self._count = 0
        slots = 1 << (2 * len(self._keys)).bit_length()  # at most half of them are taken
        self._slots = np.full(slots, _FREE, np.int64)

    def look_up(self, keys: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """Return what the function says about ``(n, width)`` keys.

        Returns
        -------
        values, places
            ``values[places[i]]`` belongs to key ``i``. Both are valid until the next call and must not be changed.
        """
        if self._count + len(keys) > len(self._keys):
            if len(keys) > len(self._keys):
                self._keys, self._values = np.zeros_like(keys), None
            self.clear()
        before = self._count
        places, self._count = _place(keys, self._keys, self._slots, before)
        if self._count > before or self._values is None:
            try:
                self._fill(before)
            except BaseException:
                self.clear()  # no key may stay without its value
                raise
        assert self._values is not None
        return self._values, places

    def _fill(self, start: int) -> None:
        found = self.function(self._keys[start : self._count])
        if self._values is None:
            self._values = np.zeros((len(self._keys), *found.shape[1:]), found.dtype)
        self._values[start : self._count] = found


@compiled
def _place(
    keys: NDArray[Any], known: NDArray[Any], slots: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], int]:
    """Return the place of each key among those known, where new ones are appended, and how many are known then."""
    places = np.empty(len(keys), np.int64)
    last = np.uint64(len(slots) - 1)
    for i in range(len(keys)):
        mixed = np.uint64(0)
        for part in keys[i]:
            mixed = (mixed ^ np.uint64(part)) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(32)
        slot = mixed & last
        while slots[slot] != _FREE and not np.array_equal(known[slots[slot]], keys[i]):
            slot = (slot + np.uint64(1)) & last
        if slots[slot] == _FREE:
            slots[slot] = count
            known[count] = keys[i]
            count += 1
        places[i] = slots[slot]
    return places, count
