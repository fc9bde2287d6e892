"""Sorts of pieces: which are always beside something larger, whatever else has their colour."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.arrays import Arrays
from semrl.core.kernels import compiled
from semrl.core.protocols import Saved
from semrl.perception.detection.foreground_kernels import Places

LEAST_PIECES = 15
"""Of a sort, to be judged by what they touch."""

LENIENCE = 5 / 6
"""Times the share that colours need: pieces of one size are more alike than all of one colour."""

MOST_SORTS = 4096
"""What is of another sort than the first so many is not judged."""

_LONGEST = 4096


class Sorts(Saved):
    """How often pieces of one colour, height and width touch a larger piece of some colour.

    Black is the roof of one thing and a thing of its own elsewhere: of its colour alone it cannot be said.

    Parameters
    ----------
    share
        Share of the pieces of a sort that must touch a larger one of a colour, to be part of such, times `LENIENCE`.
    """

    SAVED = ("_keys", "_pieces", "_touches", "_parts", "_wholes")

    def __init__(self, share: float) -> None:
        self.share = share
        self._keys: Ints = np.zeros(0, np.int64)  # (s,)
        self._pieces: Ints = np.zeros(0, np.int64)  # (s,) of each sort
        self._touches: Ints = np.zeros((0, 0), np.int64)  # (s, k) those that touch a larger one of each colour
        self._parts: Ints = np.zeros(0, np.int64)  # (p,) keys of sorts that are parts, ascending
        self._wholes: NDArray[np.bool_] = np.zeros((0, 0), np.bool_)  # (p, k + 1) of what, at last of other colours

    def learn(self, keys: Ints, colours: Ints, larger: NDArray[np.bool_]) -> None:
        """Count the pieces of one frame.

        Parameters
        ----------
        keys
            ``(n,)``, see `keys_of`.
        colours
            ``(n,)``, of each; −1 for none that is known.
        larger
            ``(n, n)``, whether each (rows) touches each other and is smaller.
        """
        more = max(int(colours.max(initial=-1)) + 1 - self._touches.shape[1], 0)
        new = np.setdiff1d(keys, self._keys)[: MOST_SORTS - len(self._keys)]
        self._keys = np.concatenate([self._keys, new])
        self._pieces = np.pad(self._pieces, (0, len(new)))
        self._touches = np.pad(self._touches, ((0, len(new)), (0, more)))
        order = np.argsort(self._keys)
        for i, place in enumerate(np.searchsorted(self._keys, keys, sorter=order)):
            if place == len(order) or self._keys[order[place]] != keys[i] or colours[i] < 0:
                continue
            met = colours[larger[i]]
            self._pieces[order[place]] += 1
            self._touches[order[place], np.unique(met[met >= 0])] += 1

    def settle(self, is_ground: NDArray[np.bool_]) -> None:
        """Decide which are parts, given which of the colours is that of the ground, ``(k,)``."""
        touches = np.pad(self._touches, ((0, 0), (0, len(is_ground) - self._touches.shape[1])))
        enough = self._pieces >= LEAST_PIECES
        enough &= ~is_ground[self._keys // _LONGEST**2]
        whole = (touches >= LENIENCE * self.share * self._pieces[:, None]) & enough[:, None] & ~is_ground
        parts = np.flatnonzero(whole.any(axis=1))
        parts = parts[np.argsort(self._keys[parts])]
        self._parts, self._wholes = self._keys[parts], np.pad(whole[parts], ((0, 0), (0, 1)))

    @property
    def any(self) -> bool:
        """Whether there are parts."""
        return bool(len(self._parts))

    def attached(self, keys: Ints, colours: Ints) -> NDArray[np.bool_]:
        """Return whether each piece (rows) is part of larger ones of the colour of each other, ``(n, n)``."""
        places = np.minimum(np.searchsorted(self._parts, keys), len(self._parts) - 1)
        known = self._parts[places] == keys
        return np.asarray(self._wholes[places][:, colours] & known[:, None])

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know of none."""
        if arrays:
            super().from_arrays(arrays)


@compiled
def keys_of(places: Places, ends: Ints, colours: Ints, width: int) -> Ints:
    """Return the number of the sort of each piece, ``(n,)``: of its colour, height and width; −1: not known."""
    keys = np.full(len(ends), -1, np.int64)
    start = 0
    for i in range(len(ends)):
        top, bottom, left, right = _LONGEST, 0, _LONGEST, 0
        for place in places[start : ends[i]]:
            r, c = place // width, place % width
            top, bottom, left, right = min(top, r), max(bottom, r), min(left, c), max(right, c)
        if colours[i] >= 0:
            keys[i] = (colours[i] * _LONGEST + bottom - top) * _LONGEST + right - left
        start = ends[i]
    return keys
