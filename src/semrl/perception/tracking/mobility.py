"""Which kinds of things move: what is of one that does is no scenery before its first step."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints, Tracks
from semrl.core.arrays import Arrays
from semrl.core.protocols import Saved
from semrl.core.things import LEAST_MOVING_SHARE
from semrl.perception.tracking.tints import LEAST_SEEN

STEADY_DECISIONS = 5
"""After so many decisions it shows whether a track moves."""

RESTING_DECISIONS = 50
"""For so many decisions in all a thing may stand still and pass for moving, if it is of a kind that moves."""


def moving(tracks: Tracks) -> NDArray[np.bool_]:
    """Tell which tracks are seen, were followed for long enough to tell, and move now and then, ``(n,)``."""
    steady = tracks.ages >= STEADY_DECISIONS
    return np.asarray(tracks.visible & steady & (tracks.moves >= LEAST_MOVING_SHARE * tracks.ages))


class Mobility(Saved):
    """Tells what moves from scenery: by its own steps, and by those of its kind.

    A track alone shows nothing at first: a thing that was just seen has made no step, and things that march together
    may stand for thirty decisions between two. Nor does it show that a thing that moved has become one that stays.

    Attributes
    ----------
    shares_ : ndarray
        ``(k,)`` float64, share of the decisions at which a thing of each kind goes a step, NaN where that is not known;
        none before it is settled.
    """

    SAVED = ("shares_", "_counts", "_ids", "_moves")

    def __init__(self) -> None:
        self.shares_: NDArray[np.float64] = np.zeros(0)
        self._counts: Ints = np.zeros((2, 0, 0), np.int64)  # (2, c, t): steps of each class and colour, and sightings
        self._ids: Ints = np.zeros(0, np.int64)  # of the tracks of the decision before
        self._moves: Ints = np.zeros(0, np.int64)

    def learn(self, tracks: Tracks, tints: Ints) -> None:
        """Count the tracks of a decision, given the colour of each, ``(n,)``; decisions are expected in their order."""
        before = np.zeros(len(tracks), np.int64)
        before[np.isin(tracks.ids, self._ids)] = self._moves[np.isin(self._ids, tracks.ids)]
        self._ids, self._moves = tracks.ids, tracks.moves
        followed = tracks.visible & (tracks.ages > 0)
        looks = tracks.classes[followed], tints[followed]
        more = [int(one.max(initial=-1)) + 1 - n for one, n in zip(looks, self._counts.shape[1:], strict=True)]
        self._counts = np.pad(self._counts, [(0, 0), *((0, max(n, 0)) for n in more)])
        np.add.at(self._counts[0], looks, tracks.moves[followed] > before[followed])
        np.add.at(self._counts[1], looks, 1)

    def settle(self, numbers: Ints) -> None:
        """Take over the kind of each class in each colour, ``(c, t)``; see `Tints.numbers_`."""
        steps, seen = np.zeros((2, int(numbers.max(initial=-1)) + 1), np.int64)
        c, t = np.minimum(numbers.shape, self._counts.shape[1:])
        for counts, counted in zip((steps, seen), self._counts, strict=True):
            np.add.at(counts, numbers[:c, :t], counted[:c, :t])
        self.shares_ = np.where(seen >= LEAST_SEEN, steps / np.maximum(seen, 1), np.nan)

    def stays(self, tracks: Tracks, kinds: Ints) -> NDArray[np.bool_]:
        """Tell which tracks are scenery, ``(n,)``, given their kinds, ``(n,)``.

        Things of a kind that is known to stay do; of others it shows by their steps, later where their kind moves.
        """
        shares = np.append(self.shares_, np.nan)[np.minimum(kinds, len(self.shares_))]
        counted = np.where(shares >= LEAST_MOVING_SHARE, tracks.ages - RESTING_DECISIONS, np.maximum(tracks.ages, 1))
        return np.asarray((shares < LEAST_MOVING_SHARE) | (tracks.moves < LEAST_MOVING_SHARE * counted))

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know nothing of kinds."""
        if arrays:
            super().from_arrays(arrays)
