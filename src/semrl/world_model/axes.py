"""Which numbers of a state are about one thing, and which of them say where it is."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints

NO_AXIS = -1
"""Of a number that says whether a thing is seen."""


def is_place(axes: Ints) -> NDArray[np.bool_]:
    """Tell which numbers say where things are; see `StateSpace.axes`."""
    places: NDArray[np.bool_] = (axes == 0) | (axes == 1)
    return places


def things_of(axes: Ints) -> Ints:
    """Return which thing each number is about, ``(d,)`` int64: where it lies, and last whether it is seen.

    Parameters
    ----------
    axes
        See `StateSpace.axes`. Where nothing says whether things are seen, all numbers are about one.
    """
    ends = (axes == NO_AXIS).astype(np.int64)
    things: Ints = np.cumsum(ends) - ends
    return things
