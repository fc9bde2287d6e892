"""How far things jump from one decision to the next: learned from the play, so that a jump ends no track."""

from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from semrl.core import IMAGE_SIZE_PX, Floats
from semrl.core.arrays import Arrays
from semrl.core.protocols import Saved

LEAST_JUMPS = 10
"""Before, that something came where something else left may be chance."""

LEAST_EVEN_SHARE = 0.5
"""Of the decisions at which anything leaves or comes, share at which as many come as leave if these are jumps.

If things left and came by chance, each at a rate of its own, it would be 0.2 at most, whatever the rates."""

LONGEST_PX = IMAGE_SIZE_PX / 3
"""Jumps are no longer than this, in the middle; places that have nothing to do with each other are farther apart."""

COVERED = 0.95
"""Share of the jumps that are within reach; the farthest may be something else."""

_SLACK = 1.1


class Jumps(Saved):
    """Counts what leaves its place for farther than a gate, and what comes there.

    On a grid, or where many frames are skipped, a thing goes farther in one decision than things are apart, and no
    gate that is right elsewhere would do. What jumps is one thing before and after: as many come as leave, at the same
    decision. What ends and begins does so at decisions of its own, or far away.

    Parameters
    ----------
    gate_px
        What goes no farther needs no jump.

    Attributes
    ----------
    reach_px_ : float
        How far things jump; 0.0 where they do not, as far as is known.
    """

    SAVED = ("_centres", "_farthest", "_events", "_even")

    def __init__(self, gate_px: float) -> None:
        self.gate_px = gate_px
        self._centres: Floats = np.zeros((0, 2), np.float32)  # of the decision before
        self._farthest = np.zeros(0, np.float32)  # of the jumps of each decision that has some
        self._events = 0  # decisions at which anything left or came
        self._even = 0  # of these, those at which as many came as left
        self._restored()

    def partial_fit(self, centres_px: Floats, *, begins: bool) -> Self:
        """Learn from what is seen at the next decision.

        Parameters
        ----------
        centres_px
            ``(n, 2)``, of all objects, row and column.
        begins
            Whether an episode begins here, in which nothing was before.
        """
        before, self._centres = self._centres, centres_px
        if begins:
            return self
        steps = cdist(before, centres_px)
        stayed = np.argwhere(_paired(np.where(steps <= self.gate_px, steps, 1e3)) & (steps <= self.gate_px))
        left = np.delete(steps, stayed[:, 0], axis=0)
        far = np.delete(left, stayed[:, 1], axis=1)
        if sum(far.shape):
            self._events += 1
        if far.shape[0] == far.shape[1] > 0:
            self._even += 1
            self._farthest = np.append(self._farthest, np.float32(far[_paired(far)].max()))
        self._restored()
        return self

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know of no jumps."""
        if arrays:
            super().from_arrays(arrays)

    def _restored(self) -> None:
        jumps = self._even >= max(LEAST_JUMPS, LEAST_EVEN_SHARE * self._events)
        jumps = jumps and bool(np.median(self._farthest) <= LONGEST_PX)
        self.reach_px_ = _SLACK * float(np.quantile(self._farthest, COVERED)) if jumps else 0.0


def _paired(costs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which pairs cost least together, as a mask."""
    mask = np.zeros(costs.shape, np.bool_)
    mask[linear_sum_assignment(costs)] = True
    return mask
