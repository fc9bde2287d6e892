"""Scenery: the kinds of objects that never move, such as walls and the digits of a score."""

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.protocols import Saved

LEAST_MOVED_SHARE = 0.1
"""Share of a kind's objects that must have moved since the frame before, else the kind is scenery.

In random play of Pong, ball and paddles have moved in 50 to 100 % of the frames, walls and digits in 0 to 3 %.
"""


class Scenery(Saved):
    """Learns which kinds of objects stand still.

    An object has moved when the frame before had none of its class at the very same place.

    Attributes
    ----------
    frames_ : int
        Frames seen so far.
    """

    SAVED = ("frames_", "_objects", "_moved", "_places")

    def __init__(self) -> None:
        self.frames_ = 0
        self._objects = np.zeros(0, np.int64)  # by class: objects seen
        self._moved = np.zeros(0, np.int64)  # by class: of those, moved
        self._places = np.zeros((0, 3), np.float64)  # class, row, column in the frame before

    @property
    def still_(self) -> Ints:
        """Class numbers of the kinds that stand still, ``(k,)`` int64, ascending; none that was never met."""
        return np.flatnonzero(self.is_still(np.arange(len(self._objects))))

    @property
    def moving_(self) -> Ints:
        """Class numbers of the kinds that move, ``(k,)`` int64, ascending; none that was never met."""
        return np.flatnonzero(~self.is_still(np.arange(len(self._objects))) & (self._objects > 0))

    def is_still(self, classes: Ints) -> NDArray[np.bool_]:
        """Say of each of ``(n,)`` classes whether it is of a kind that stands still."""
        still = self._moved < LEAST_MOVED_SHARE * self._objects  # false where none was met
        return np.isin(classes, np.flatnonzero(still))

    def partial_fit(self, classes: Ints, centres_px: NDArray[Any]) -> Self:
        """Learn from one frame; frames are expected in their order.

        Parameters
        ----------
        classes
            ``(n,)``, from 0 on.
        centres_px
            ``(n, 2)``, row and column.
        """
        places = np.column_stack([classes, centres_px]).astype(np.float64)  # (n, 3)
        size = max(len(self._objects), int(classes.max(initial=-1)) + 1)
        if self.frames_:
            stayed = (places[:, None] == self._places[None]).all(axis=2).any(axis=1)  # (n,)
            self._objects = _grown(self._objects, size) + np.bincount(classes, minlength=size)
            self._moved = _grown(self._moved, size) + np.bincount(classes[~stayed], minlength=size)
        self._places = places
        self.frames_ += 1
        return self


def _grown(counts: Ints, size: int) -> Ints:
    return np.pad(counts, (0, size - len(counts)))
