"""Kinds by colour, where classes are drawn in grey: two paddles of one shape are two kinds."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.protocols import Saved

ALIKE = 32
"""Of 255: colours are one that differ by no more in every channel."""

MOST_TINTS = 32
"""What has other colours than the first so many is of the kind of its class alone."""

LEAST_SEEN = 20
"""Objects in a colour, for it to say more than the class; and objects of a class in it, to be a kind of their own."""


class Tints(Saved):
    """In which colours the objects of each class are seen.

    What a class mostly looks like keeps its number. Each other colour that some of its objects have makes these a
    kind of their own, with a number behind those of the classes. What has another colour too seldom for that is of a
    kind of that colour, whatever its class, if the colour is common: else a posture in which one of two players was
    hardly seen would be of the other's kind. That one thing may change its colour is told by who follows it: see
    `semrl.concepts`.

    Attributes
    ----------
    numbers_ : ndarray
        ``(c, k + 1)`` int64, the kind of each class in each colour, at last in a colour that was not known;
        no rows before it is settled.
    """

    SAVED = ("numbers_", "_colours", "_seen")

    def __init__(self) -> None:
        self.numbers_: Ints = np.zeros((0, 1), np.int64)
        self._colours: Floats = np.zeros((0, 3), np.float32)
        self._seen: Ints = np.zeros((0, 0), np.int64)  # (c, k) objects of each class in each colour

    def learn(self, classes: Ints, colours: Floats) -> None:
        """Count the objects of a frame, by class, ``(n,)``, and mean colour, ``(n, 3)``."""
        for colour in colours:
            if len(self._colours) < MOST_TINTS and self.tints_of(colour[None])[0] == len(self._colours):
                self._colours = np.concatenate([self._colours, colour[None]])
        more = int(classes.max(initial=-1)) + 1 - len(self._seen), len(self._colours) - self._seen.shape[1]
        self._seen = np.pad(self._seen, [(0, max(n, 0)) for n in more])
        tints = self.tints_of(colours)
        known = tints < len(self._colours)
        np.add.at(self._seen, (classes[known], tints[known]), 1)

    def settle(self) -> None:
        """Number the kinds: first the classes, then classes in other colours than most, then colours."""
        seen = np.pad(self._seen, ((0, 0), (0, 1)))  # at last in a colour that is not known
        classes, colours = np.indices(seen.shape)
        other = colours != seen.argmax(axis=1)[:, None]
        common = seen.sum(axis=0) >= LEAST_SEEN
        numbers = np.where(other & common, len(seen) + seen.size + colours, classes)
        apart = other & (seen >= LEAST_SEEN)
        numbers[apart] = len(seen) + np.arange(apart.sum())
        self.numbers_ = np.unique(numbers, return_inverse=True)[1].reshape(seen.shape)

    def kinds(self, classes: Ints, colours: Floats) -> Ints:
        """Return the kind of each object, ``(n,)`` int64: until it is settled, its class.

        A class that was not there when it was settled has the next free number, as has each other such class.
        """
        if not len(self.numbers_):
            return classes
        known = classes < len(self.numbers_)
        kinds = np.full(len(classes), self.numbers_.max() + 1)
        kinds[known] = self.numbers_[classes[known], self.tints_of(colours[known])]
        return kinds

    def is_new(self, classes: Ints, colours: Floats) -> NDArray[np.bool_]:
        """Tell of each object, ``(n,)``, whether nothing of its class had its colour until it was settled.

        Before, nothing is new; where there were too many colours to tell apart, no other colour is.
        """
        tints = self.tints_of(colours)
        known = tints < len(self._colours)
        new = np.full(len(classes), 0 < len(self._colours) < MOST_TINTS and len(self.numbers_) > 0)
        seen = known & (classes < len(self.numbers_))
        new[seen] = self._seen[classes[seen], tints[seen]] == 0
        return new

    def tints_of(self, colours: Floats) -> Ints:
        """Return which known colour each is, the nearest, ``(n,)``; as many as there are where it is none."""
        away: NDArray[np.float32] = np.abs(colours[:, None] - self._colours[None]).max(axis=2)  # (n, k)
        most = np.full((len(colours), 1), ALIKE, np.float32)
        return np.asarray(np.concatenate([away, most], axis=1).argmin(axis=1))  # the first of equals

    def commonest(self, seen: NDArray[np.float64]) -> Floats:
        """Return the colour that was seen most, ``(k, 3)``, of ``(k, t)`` sightings in each; NaN where none was."""
        seen = seen[:, : len(self._colours)]
        colours = np.full((len(seen), 3), np.nan, np.float32)
        if seen.size:
            colours = np.where(seen.sum(axis=1, keepdims=True) > 0, self._colours[seen.argmax(axis=1)], colours)
        return colours

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know kinds by class alone."""
        if arrays:
            super().from_arrays(arrays)
