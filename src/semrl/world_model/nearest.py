"""What is nearest to a thing, whichever it is: what many things have in common is learned once, not of each pair apart.

To refer to things by what they are to somebody, in place of by name, is deictic representation ("Pengi: an
implementation of a theory of activity", Agre and Chapman, AAAI 1987).
"""

from typing import NamedTuple

import numpy as np

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.world_model.axes import NO_AXIS, things_of

NEAREST = 9
"""Numbers about what is nearest: how far a thing lies from it along x and y, now and if both go on, the same four
without their signs, and which it is."""

NONE_FAR = np.float32(1e6)
"""How far away it is where none is seen; in units of the resolution, more than any image is wide."""


class Nearest(NamedTuple):
    """The ``t`` things of which each is compared with the nearest other."""

    columns: Ints
    """``(t, 3)``: which number is its x, its y, and says whether it is seen; −1 where that never changes."""
    steady: Floats
    """``(t, 3)``: x and y that never change, and above which number it is seen."""


def nearest_of(axes: Ints, varying: Ints, steady: Floats, unit: float) -> Nearest:
    """Return the things of which something varies.

    Parameters
    ----------
    axes
        See `StateSpace.axes`.
    varying
        ``(k,)``, the numbers of a state that vary: columns count these.
    steady
        ``(d,)``, what the others are, in units of the resolution.
    unit
        The resolution.
    """
    things, place = things_of(axes), np.full(len(axes), -1, np.int64)
    place[varying] = np.arange(len(varying))
    numbers = np.array(
        [
            [np.flatnonzero((things == one) & (axes == axis))[0] for axis in (0, 1, NO_AXIS)]
            for one in np.unique(things[varying]).tolist()
            if {0, 1, NO_AXIS} <= set(axes[things == one].tolist())
        ],
        np.int64,
    ).reshape(-1, 3)
    rests = np.column_stack([steady[numbers[:, :2]], np.full(len(numbers), 0.5 / unit)])
    return Nearest(place[numbers], rests.astype(np.float32))


def none_compared() -> Nearest:
    """Return what compares nothing with what is nearest."""
    return Nearest(np.zeros((0, 3), np.int64), np.zeros((0, 3), np.float32))


@compiled
def lay_out_nearest(known: Nearest, rows: Floats, at: int, n: int, dimension: int) -> None:
    """Write `NEAREST` numbers about each thing for the first ``n`` lanes.

    Parameters
    ----------
    known
        The things.
    rows
        ``(f, …)``: the state, behind it the state if all go on, and, from a place on, what is written.
    at
        That place.
    n
        How many lanes there are.
    dimension
        Length of the state.
    """
    things = len(known.columns)
    places, hidden = np.empty((2, 2, things, n), np.float32), np.empty((things, n), np.float32)
    for thing in range(things):
        for axis in range(2):
            column = known.columns[thing, axis]
            for later in range(2):
                place = places[later, axis, thing]
                if column < 0:
                    place[:] = known.steady[thing, axis]
                else:
                    place[:] = rows[later * dimension + column, :n]
        _hide(known, thing, rows, hidden[thing])
    which = _find_nearest(places[0], hidden)
    for thing in range(things):
        _measure(places, thing, which[thing], rows[at + thing * NEAREST : at + (thing + 1) * NEAREST])


@compiled
def _hide(known: Nearest, thing: int, rows: Floats, hidden: Floats) -> None:
    """Write 0 into ``(n,)`` where a thing is seen, else `NONE_FAR`."""
    column = known.columns[thing, 2]
    for s in range(len(hidden)):
        unseen = column >= 0 and rows[max(column, 0), s] <= known.steady[thing, 2]
        hidden[s] = NONE_FAR if unseen else np.float32(0)


@compiled
def _find_nearest(places: Floats, hidden: Floats) -> Floats:
    """Return which thing is nearest to each of ``t``, ``(t, n)``; −1 where none is."""
    things, n = hidden.shape
    least, which = np.full((things, n), NONE_FAR, np.float32), np.full((things, n), -1, np.float32)
    apart = np.empty(n, np.float32)
    for one in range(things):
        x, y, out = places[0, one], places[1, one], hidden[one]
        for other in range(one + 1, things):
            their_x, their_y, their_out = places[0, other], places[1, other], hidden[other]
            for s in range(n):
                across, along = abs(x[s] - their_x[s]), abs(y[s] - their_y[s])
                apart[s] = (across if across > along else along) + out[s] + their_out[s]
            _keep_nearer(least[one], which[one], apart, other)
            _keep_nearer(least[other], which[other], apart, one)
    return which


@compiled
def _keep_nearer(least: Floats, which: Floats, apart: Floats, other: int) -> None:
    number = np.float32(other)
    for s in range(len(apart)):
        nearer = apart[s] < least[s]
        which[s] = number if nearer else which[s]
        least[s] = apart[s] if nearer else least[s]


@compiled
def _measure(places: Floats, thing: int, which: Floats, numbers: Floats) -> None:
    """Write the numbers of a thing, given what is nearest to it in each lane."""
    for number in range(4):
        place, gap, apart = places[number // 2, number % 2], numbers[number], numbers[4 + number]
        own = place[thing]
        for s in range(len(own)):
            other = np.int64(which[s])
            gap[s] = own[s] - place[max(other, 0), s] if other >= 0 else NONE_FAR
            apart[s] = abs(gap[s])
    for s in range(len(which)):
        numbers[NEAREST - 1, s] = which[s]


def names_of_nearest(x: str, y: str) -> list[str]:
    """Name the numbers that `lay_out_nearest` writes about a thing whose x and y have these names."""
    both = (x, y)
    return [
        *(f"{one} − the nearest's" for one in both),
        *(f"{one} − the nearest's, if both go on," for one in both),
        *(f"|{one} − the nearest's|" for one in both),
        *(f"|{one} − the nearest's|, if both go on," for one in both),
        f"which is nearest to it, by {x} and {y},",
    ]
