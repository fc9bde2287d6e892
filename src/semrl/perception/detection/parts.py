"""Things of several pieces: which colours are parts of one thing, learned from what touches."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Frame, Ints
from semrl.core.arrays import Arrays
from semrl.core.protocols import Saved
from semrl.perception.detection.foreground_kernels import Places
from semrl.perception.detection.parts_kernels import colours_of, join, touching
from semrl.perception.detection.sorts import Sorts, keys_of

MOST_COLOURS = 64
"""What has other colours than the first so many stays as it is, and then so does what is new."""

LEAST_PIECES = 25
"""Of a colour, to be judged by what they touch."""


class Parts(Saved):
    """How often pieces of one colour touch one of another, or of the same, and so which colours make things together.

    Of two colours one is part of the other's things if nearly all of its pieces touch one of the other: wheels and
    a car. A ball and a paddle meet now and then, which makes them no one thing. Colours that were never seen are
    parts of one thing where they touch: new enemies have new colours. The colour of the ground is no part
    of anything: there it shows through. Pieces touch that have no more than one pixel between them.

    Parameters
    ----------
    share
        Share of one colour's pieces that must touch one of the other.

    Attributes
    ----------
    colours_ : ndarray
        ``(k, channels)`` uint8, the colours seen so far.
    """

    SAVED, PARTS = ("colours_", "_pieces", "_touches", "_together"), ("_sorts",)

    def __init__(self, share: float) -> None:
        self.share = share
        self.colours_: Frame = np.zeros((0, 0), np.uint8)
        self._pieces = np.zeros(0, np.int64)  # (k,) of each colour
        self._touches = np.zeros((0, 0), np.int64)  # (k, k) those of one colour that touch one of another
        self._together: NDArray[np.bool_] = np.zeros((1, 1), np.bool_)  # (k + 1, k + 1), at last of all other colours
        self._sorts = Sorts(share)

    def learn(self, frame: Frame, places: Places, ends: Ints) -> None:
        """Count what touches among the pieces of one frame, as `find_components` returns them."""
        height, width, channels = frame.shape
        first = places[np.append(0, ends[:-1])] if len(ends) else places
        shown = np.concatenate([self.colours_.reshape(-1, channels), frame.reshape(-1, channels)[first]])
        _, order = np.unique(shown, axis=0, return_index=True)
        self.colours_ = shown[np.sort(order)][:MOST_COLOURS]
        more = len(self.colours_) - len(self._pieces)
        self._pieces, self._touches = np.pad(self._pieces, (0, more)), np.pad(self._touches, (0, more))
        colours = colours_of(frame, places, ends, self.colours_)
        touch = touching(places, ends, height, width)
        for i in np.flatnonzero(colours >= 0):
            self._pieces[colours[i]] += 1
            met = colours[touch[i]]
            self._touches[colours[i], np.unique(met[met >= 0])] += 1
        self._sorts.learn(keys_of(places, ends, colours, width), colours, touch & _larger(ends))

    def settle(self, background: Frame) -> None:
        """Decide which colours go together, given what is behind everything, ``(height, width, channels)``."""
        ground, area = np.unique(background.reshape(-1, background.shape[2]), axis=0, return_counts=True)
        is_ground = np.append((self.colours_ == ground[area.argmax()]).all(axis=1), False)
        enough = np.append(self._pieces >= LEAST_PIECES, False)
        shares = np.pad(self._touches / np.maximum(self._pieces, 1)[:, None], (0, 1))
        together = (np.maximum(shares, shares.T) >= self.share) & enough[:, None] & enough[None]
        if len(self.colours_) < MOST_COLOURS:
            together[-1, -1] = True
        self._together = together & ~is_ground[:, None] & ~is_ground[None]
        self._sorts.settle(is_ground[:-1])

    def joined(self, frame: Frame, places: Places, ends: Ints) -> tuple[Places, Ints]:
        """Make one object of those that touch and whose colours go together."""
        height, width, _ = frame.shape
        colours = colours_of(frame, places, ends, self.colours_)
        alike = self._together[np.ix_(colours, colours)]
        if self._sorts.any:
            parts = self._sorts.attached(keys_of(places, ends, colours, width), colours) & _larger(ends)
            alike |= parts | parts.T
        if not alike.any():
            return places, ends
        return join(places, ends, touching(places, ends, height, width) & alike)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this join no colours that they do not know."""
        super().from_arrays(arrays)
        more = len(self.colours_) + 1 - len(self._together)
        self._together = np.pad(self._together, (0, more))


def _larger(ends: Ints) -> NDArray[np.bool_]:
    """Return which of the pieces (columns) are larger than which (rows), ``(n, n)``."""
    sizes = np.diff(ends, prepend=0)
    return np.asarray(sizes > sizes[:, None])
