"""Between which bounds the numbers of states lay in all play that was learned from."""

from typing import Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.arrays import Arrays


class Extent:
    """The lowest and the highest of each number of the states, while what it is about was seen.

    Parameters
    ----------
    dimension
        Length of a state.
    seen
        ``(dimension,)`` int64: which number says whether what each is about is seen; None: all always is.

    Attributes
    ----------
    bounds_ : ndarray
        ``(2, dimension)`` float64, lowest and highest; NaN for what was never seen.
    """

    def __init__(self, dimension: int, seen: Ints | None = None) -> None:
        self.seen = seen
        self.bounds_ = np.full((2, dimension), np.nan)

    def partial_fit(self, states: NDArray[np.floating]) -> Self:
        """Take ``(n, dimension)`` states in."""
        shown = states if self.seen is None else np.where(states[:, self.seen] > 0.5, states, np.nan)
        rows = np.concatenate([self.bounds_, shown])
        self.bounds_ = np.stack([np.fmin.reduce(rows), np.fmax.reduce(rows)])  # which leave NaN out
        return self

    def to_arrays(self) -> Arrays:
        """Return the bounds."""
        return {"bounds": self.bounds_}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.bounds_ = arrays["bounds"]
