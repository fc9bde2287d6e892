"""Which roles are one: what always moves as one is one thing, and what takes turns has one part."""

import numpy as np
from numpy.typing import NDArray

from semrl.arrays import Arrays
from semrl.types import Floats, Ints

_NAMES = ("together", "offsets", "deviations")
CLOSE_PX = 12.0
"""Parts of one thing have centres no farther apart than this, on average."""

RIGID_PX = 0.5
"""Parts of one thing keep their offset to within this, in standard deviation."""

LEAST_TOGETHER = 0.5
"""Share of the frames with the rarer of two roles in which the other must have been seen as well."""

MOST_TOGETHER = 0.05
"""Share of these frames up to which two roles take turns."""


class Bonds:
    """For each pair of roles, how steady the offset of the two is.

    What does not touch, or not always, is several objects to a detector, though it may be one thing. To be told of one
    is enough.
    """

    def __init__(self) -> None:
        self._together = np.zeros((0, 0))  # (r, r) frames in which both were seen
        self._offsets = np.zeros((0, 0, 2))  # (r, r, 2) mean way from one to the other, in pixels
        self._deviations = np.zeros((0, 0, 2))  # sums of squared deviations from these

    def learn(self, roles: Ints, centres_px: Floats) -> None:
        """Learn from one frame: ``(n,)`` roles, each at most once, and ``(n, 2)`` centres."""
        more = max(int(roles.max(initial=-1)) + 1 - len(self._together), 0)
        wider = ((0, more), (0, more), (0, 0))
        self._together = np.pad(self._together, wider[:2])
        self._offsets, self._deviations = np.pad(self._offsets, wider), np.pad(self._deviations, wider)
        pairs = np.ix_(roles, roles)
        self._together[pairs] += 1
        offsets = (centres_px[None] - centres_px[:, None]).astype(np.float64)  # (n, n, 2)
        away = offsets - self._offsets[pairs]
        self._offsets[pairs] += away / self._together[pairs][:, :, None]
        self._deviations[pairs] += away * (offsets - self._offsets[pairs])

    def joined(self, n_roles: int) -> NDArray[np.bool_]:
        """Return whether each pair of roles is one thing, ``(n_roles, n_roles)``, symmetric."""
        result = np.eye(n_roles, dtype=bool)
        n = len(self._together)
        seen = np.diag(self._together)
        counts = np.maximum(self._together, 1)[:, :, None]
        rigid = (self._deviations / counts).sum(axis=2) < RIGID_PX**2
        close = np.square(self._offsets).sum(axis=2) < CLOSE_PX**2
        often = self._together > LEAST_TOGETHER * np.minimum(seen[:, None], seen[None])
        result[:n, :n] |= rigid & close & often
        return result

    def apart(self, role: int, other: int) -> bool:
        """Return whether two roles take turns: hardly ever are both seen."""
        return bool(self._together[role, other] <= MOST_TOGETHER * self._together[[role, other], [role, other]].min())

    def to_arrays(self) -> Arrays:
        """Return what was counted."""
        return {name: getattr(self, f"_{name}").copy() for name in _NAMES}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where `to_arrays` was called."""
        for name in _NAMES:
            setattr(self, f"_{name}", arrays[name].copy())
