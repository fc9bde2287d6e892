"""Trees that predict a velocity: each leaf holds the next one itself, or by how much it changes, whichever fits better.

A thing in flight keeps its velocity, one that is steered takes what the action gives it, and one that bounces does the
one before and the other after. So a cut is worth what it takes off the better of the two errors on each of its sides.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.world_model.cart import part
from semrl.world_model.tree_kernels import NODE

ABSOLUTE = -2
"""In place of a left child: a leaf that holds the next velocity itself, not by how much it changes."""

_SUMS = 5  # rows; next velocities and their squares; changes and theirs
_ALIKE_PX2 = 1e-3  # squared error that is none


def grow_motion(
    places: NDArray[np.uint16], cuts: list[Floats], velocities: tuple[Floats, Floats], drawn: Ints, limits: Ints | Any
) -> NDArray[Any]:
    """Grow one tree.

    Parameters
    ----------
    places, cuts
        See `semrl.world_model.cart.bins_of`.
    velocities
        ``(n,)`` float32 each: the present and the next.
    drawn
        ``(k,)`` rows to learn from.
    limits
        Fewest rows in a leaf, and least squared error that a cut takes away.

    Returns
    -------
    ndarray
        ``(m,)`` of `NODE`, level by level; leaves have the column −1 and, in place of a child, −1 or `ABSOLUTE`.
    """
    widths = np.array([len(column) + 1 for column in cuts], np.int64)
    now, after = (np.asarray(part, np.float64) for part in velocities)
    nodes, chosen, means = _grow(places, widths, (after, after - now), drawn.copy(), int(limits[0]), float(limits[1]))
    tree = np.empty(len(nodes), NODE)
    tree["column"], tree["left"], tree["mean"] = nodes[:, 0], nodes[:, 1], means
    inner = nodes[:, 0] >= 0
    tree["cut"] = 0
    tree["cut"][inner] = [cuts[column][cut] for column, cut in zip(nodes[inner, 0], chosen[inner], strict=True)]
    return tree


@compiled
def _grow(  # noqa: PLR0917 - compiled functions take no keywords
    places: NDArray[np.uint16],
    widths: Ints,
    wanted: tuple[NDArray[np.float64], NDArray[np.float64]],
    rows: Ints,
    leaf_rows: int,
    least_gain: float,
) -> tuple[NDArray[np.int32], Ints, NDArray[np.float64]]:
    """Return column and left child, bin after which to cut, and what each node predicts."""
    most = 2 * (len(rows) // leaf_rows) + 1
    nodes, chosen, means = np.full((most, 2), -1, np.int32), np.zeros(most, np.int64), np.zeros(most)
    spans = np.zeros((most, 2), np.int64)
    spans[0, 1] = len(rows)
    counted = np.zeros((widths.max(), _SUMS))
    at, size = 0, 1
    while at < size:
        begin, end = spans[at]
        mine = rows[begin:end]
        total = _sums(mine, wanted)
        itself, change = _errors(total)
        means[at] = total[1] / total[0] if itself < change - _ALIKE_PX2 else total[3] / total[0]
        nodes[at, 1] = ABSOLUTE if itself < change - _ALIKE_PX2 else -1
        if min(itself, change) > least_gain and len(mine) >= 2 * leaf_rows:
            column, cut = _best_cut(mine, places, widths, wanted, total, counted, leaf_rows, least_gain)
            if column >= 0:
                middle = begin + part(mine, places[column], cut)
                nodes[at, 0], nodes[at, 1], chosen[at] = column, size, cut
                spans[size, 0], spans[size, 1] = begin, middle
                spans[size + 1, 0], spans[size + 1, 1] = middle, end
                size += 2
        at += 1
    return nodes[:size], chosen[:size], means[:size]


@compiled
def _sums(rows: Ints, wanted: tuple[NDArray[np.float64], NDArray[np.float64]]) -> NDArray[np.float64]:
    after, change = wanted
    total = np.zeros(_SUMS)
    for row in rows:
        total[0] += 1
        total[1] += after[row]
        total[2] += after[row] ** 2
        total[3] += change[row]
        total[4] += change[row] ** 2
    return total


@compiled
def _errors(sums: NDArray[np.float64]) -> tuple[float, float]:
    """Return the squared errors of predicting the mean next velocity, and the mean change."""
    return sums[2] - sums[1] ** 2 / sums[0], sums[4] - sums[3] ** 2 / sums[0]


@compiled
def _best_cut(  # noqa: PLR0917
    rows: Ints,
    places: NDArray[np.uint16],
    widths: Ints,
    wanted: tuple[NDArray[np.float64], NDArray[np.float64]],
    total: NDArray[np.float64],
    counted: NDArray[np.float64],
    leaf_rows: int,
    least_gain: float,
) -> tuple[int, int]:
    """Return the column and the bin after which to cut; −1 where no cut takes enough error away."""
    after, change = wanted
    left, right = np.empty(_SUMS), np.empty(_SUMS)
    whole = min(_errors(total)[0], _errors(total)[1])
    best, column, cut = least_gain, -1, -1
    for c in range(len(widths)):
        bins = places[c]
        low = high = bins[rows[0]]
        for row in rows:
            low, high = min(low, bins[row]), max(high, bins[row])
        if low == high:
            continue
        counted[low : high + 1] = 0
        for row in rows:
            one = counted[bins[row]]
            one[0] += 1
            one[1] += after[row]
            one[2] += after[row] ** 2
            one[3] += change[row]
            one[4] += change[row] ** 2
        left[:] = 0
        for place in range(low, high):
            if counted[place, 0] == 0:
                continue
            left += counted[place]
            if left[0] < leaf_rows:
                continue
            if total[0] - left[0] < leaf_rows:
                break
            right[:] = total - left
            one, other = _errors(left), _errors(right)
            gain = whole - min(one[0], one[1]) - min(other[0], other[1])
            if gain > best + 1e-9:
                best, column, cut = gain, c, place
    return column, cut
