"""Which kinds of things move: what is of one that does is no scenery before its first step."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, Tracks
from semrl.core.arrays import Arrays
from semrl.core.kernels import compiled
from semrl.core.protocols import Saved
from semrl.core.things import LEAST_MOVING_SHARE
from semrl.perception.tracking.tints import LEAST_SEEN

STEADY_DECISIONS = 5
"""After so many decisions it shows whether a track moves."""

RESTING_DECISIONS = 50
"""For so many decisions in all a thing may stand still and pass for moving, if it is of a kind that moves."""

MOBILE_SHARE = 0.5
"""Share of its sightings at which a thing of a kind must go a step then or soon, for the kind to move."""

_EPISODE, _ID, _DECISION, _CLASS, _TINT, _MOVES, _ROW, _COLUMN = range(8)


def moving(tracks: Tracks) -> NDArray[np.bool_]:
    """Tell which tracks are seen, were followed for long enough to tell, and move now and then, ``(n,)``."""
    steady = tracks.ages >= STEADY_DECISIONS
    return np.asarray(tracks.visible & steady & (tracks.moves >= LEAST_MOVING_SHARE * tracks.ages))


class Mobility(Saved):
    """Tells what moves from scenery: by its own steps, and by those of its kind.

    A track alone shows nothing at first: a thing that was just seen has made no step, and things that march together
    may stand for thirty decisions between two. Nor does it show that a thing that moved has become one that stays. A
    kind tells the first only where it goes: a digit may look like a shot.

    Attributes
    ----------
    shares_ : ndarray
        ``(k, 2)`` float64, at which share of its sightings a thing of each kind goes a step, and at which then or
        within fifty decisions; NaN where that is not known. None before it is settled.
    ranges_px_ : ndarray
        ``(k, 4)`` float64, least row and column at which a thing of each kind was about to go a step, and greatest.
    """

    SAVED = ("shares_", "ranges_px_", "_sightings", "_clock")

    def __init__(self) -> None:
        self.shares_: NDArray[np.float64] = np.zeros((0, 2))
        self.ranges_px_: NDArray[np.float64] = np.zeros((0, 4))
        self._sightings: NDArray[np.float64] = np.zeros((0, 8))  # in the columns above
        self._clock: Ints = np.zeros(2, np.int64)  # episodes and decisions

    def learn(self, tracks: Tracks, tints: Ints) -> None:
        """Note the tracks of a decision, given the colour of each, ``(n,)``; decisions are expected in their order."""
        self._clock = self._clock + np.array([tracks.ages.max(initial=0) == 0, 1])
        n, seen = len(tracks), tracks.visible
        episode, decision = np.broadcast_to(self._clock, (n, 2)).T
        looks = [episode, tracks.ids, decision, tracks.classes, tints, tracks.moves, tracks.centres_px]
        self._sightings = np.concatenate([self._sightings, np.column_stack(looks)[seen]])

    def settle(self, numbers: Ints) -> None:
        """Judge the kinds, given that of each class in each colour, ``(c, t)``; see `Tints.numbers_`."""
        rows = self._sightings[np.lexsort(self._sightings.T[[_DECISION, _ID, _EPISODE]])]
        steps, soon = _steps(rows)
        kinds = numbers[rows[:, _CLASS].astype(np.int64), rows[:, _TINT].astype(np.int64)]
        known = int(numbers.max(initial=-1)) + 1
        seen, *moved = (np.bincount(kinds, weights=w, minlength=known) for w in (np.ones(len(rows)), steps, soon))
        self.shares_ = np.column_stack(moved) / np.where(seen >= LEAST_SEEN, seen, np.nan)[:, None]
        self.ranges_px_ = np.tile([np.inf, np.inf, -np.inf, -np.inf], (known, 1))
        places = rows[soon][:, [_ROW, _COLUMN]]
        np.minimum.at(self.ranges_px_[:, :2], kinds[soon], places)
        np.maximum.at(self.ranges_px_[:, 2:], kinds[soon], places)
        self._sightings = self._sightings[:0]

    def stays(self, tracks: Tracks, kinds: Ints) -> NDArray[np.bool_]:
        """Tell which tracks are scenery, ``(n,)``, given their kinds, ``(n,)``.

        Things of a kind that hardly ever goes a step, and is not mostly about to, do; of others it shows by their own
        steps, later where their kind moves.
        """
        return _stays(kinds, tracks.centres_px, tracks.ages, tracks.moves, self.shares_, self.ranges_px_)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know nothing of kinds."""
        if arrays:
            super().from_arrays(arrays)


def _steps(rows: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell at which sightings, sorted by track and time, a thing goes a step, and at which then or soon."""
    steps = np.zeros(len(rows), np.bool_)
    same = (rows[1:, : _ID + 1] == rows[:-1, : _ID + 1]).all(axis=1)
    steps[1:] = same & (rows[1:, _MOVES] > rows[:-1, _MOVES])
    places = np.where(steps, np.arange(len(rows)), len(rows) - 1)
    following = np.minimum.accumulate(places[::-1])[::-1]  # the next sighting with a step, or the last of all
    mine = (rows[following, : _ID + 1] == rows[:, : _ID + 1]).all(axis=1) & steps[following]
    near = rows[following, _DECISION] - rows[:, _DECISION] <= RESTING_DECISIONS
    return steps, mine & near


@compiled
def _stays(  # noqa: PLR0917 - compiled functions take no keywords
    kinds: Ints, centres: Floats, ages: Ints, moves: Ints, shares: NDArray[np.float64], ranges: NDArray[np.float64]
) -> NDArray[np.bool_]:
    result = np.empty(len(kinds), np.bool_)
    for i in range(len(kinds)):
        counted, of_scenery = max(ages[i], 1), False
        if kinds[i] < len(shares):
            step, soon = shares[kinds[i]]
            top, left, bottom, right = ranges[kinds[i]]
            row, column = centres[i]
            of_scenery = step < LEAST_MOVING_SHARE and soon < MOBILE_SHARE
            if soon >= MOBILE_SHARE and top <= row <= bottom and left <= column <= right:
                counted = ages[i] - RESTING_DECISIONS
        result[i] = of_scenery or moves[i] < LEAST_MOVING_SHARE * counted
    return result
