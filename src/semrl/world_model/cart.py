"""Growing regression trees (CART, Breiman et al. 1984) in compiled code.

Numbers are put into bins first, one for each value where there are few, so that the best cut of a number is found by
one pass over the rows and one over the bins, without sorting. On 50,000 rows of play this is some ten times faster
than a library that sorts, and trees that are grown while a game is going on are grown often.
"""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.world_model.cuts import (
    MAX_BINS,
    NONE,
    begin_tally,
    best_cut,
    give_back,
    new_pool,
    pass_on,
    sums_are_exact,
)


def bins_of(rows: Floats) -> tuple[NDArray[np.uint16], list[Floats]]:
    """Put the numbers of ``(n, d)`` rows into bins.

    Returns
    -------
    tuple
        ``(d, n)`` numbers of bins, and for each column the cuts between its bins, ascending: a number belongs to
        bin ``i`` when it exceeds ``i`` cuts. At most 512 bins; where there are more values, about equally many
        rows in each.
    """
    places = np.empty((rows.shape[1], len(rows)), np.uint16)
    cuts = []
    for i, column in enumerate(rows.T):
        values = np.unique(column)
        if len(values) > MAX_BINS:
            values = np.unique(np.quantile(column, np.linspace(0, 1, MAX_BINS), method="nearest"))
        cuts.append(((values[:-1] + values[1:]) / 2).astype(np.float32))
        places[i] = np.searchsorted(cuts[-1], column)
    return places, cuts


def grow_tree(
    places: NDArray[np.uint16], cuts: list[Floats], targets: NDArray[np.float64], drawn: Ints, leaf_rows: int
) -> tuple[NDArray[np.int32], Floats, Floats]:
    """Grow one tree that predicts a number, by the squared error.

    Parameters
    ----------
    places, cuts
        See `bins_of`.
    targets
        ``(n,)``, what is to be predicted for each row.
    drawn
        ``(k,)`` numbers of the rows to learn from, with repetitions.
    leaf_rows
        Fewest of them in a leaf.

    Returns
    -------
    tuple
        ``(m, 2)`` column and left child of each node, both −1 in leaves (the right child comes after the left);
        ``(m, 2)`` cut, at and below which it goes left, and mean; ``(m, 2)`` number of rows and mean squared error.
    """
    widths = np.array([len(column) + 1 for column in cuts], np.int64)
    nodes, chosen, moments = _grow(places, widths, targets, drawn, leaf_rows)
    inner = np.flatnonzero(nodes[:, 0] >= 0)
    numbers = np.zeros((len(nodes), 2), np.float32)
    numbers[inner, 0] = [cuts[column][cut] for column, cut in zip(nodes[inner, 0], chosen[inner], strict=True)]
    numbers[:, 1] = moments[:, 0]
    return nodes, numbers, moments[:, 1:].astype(np.float32)


@compiled
def _grow(
    places: NDArray[np.uint16], widths: Ints, targets: NDArray[np.float64], drawn: Ints, leaf_rows: int
) -> tuple[NDArray[np.int32], Ints, NDArray[np.float64]]:
    """Return column and left child, bin after which to cut, and mean, rows and mean squared error of each node."""
    times = np.bincount(drawn, minlength=len(targets))  # a row drawn twice counts twice, but is looked at once
    rows = np.flatnonzero(times)  # ascending, so memory is read in its order
    begins = np.concatenate((np.zeros(1, np.int64), np.cumsum(widths)))
    sample, pool = (places, begins, targets * times, times), new_pool(len(rows), begins[-1])
    most = 2 * (len(drawn) // leaf_rows) + 1
    nodes = np.full((most, 2), -1, np.int32)
    chosen, moments = np.zeros(most, np.int64), np.zeros((most, 3))
    spans = np.zeros((most, 2), np.int64)  # which of the rows belong to a node
    spans[0, 1] = len(rows)
    tallies = np.full(most, NONE)
    if sums_are_exact(targets, times):
        tallies[0] = begin_tally(rows, sample, pool)
    size, waiting = 1, [0]
    while waiting:
        node = waiting.pop()
        begin, end = spans[node]
        mine = rows[begin:end]
        moments[node] = _moments(targets[mine], times[mine])
        column, cut = -1, -1
        if moments[node, 2] > 0 and moments[node, 1] >= 2 * leaf_rows:
            column, cut = best_cut(mine, tallies[node], sample, pool, leaf_rows)
        if column < 0:
            give_back(tallies[node], pool)
            continue
        middle = begin + part(mine, places[column], cut)
        nodes[node] = column, size
        chosen[node] = cut
        spans[size], spans[size + 1] = (begin, middle), (middle, end)
        left_is_smaller = middle - begin <= end - middle
        smaller, larger = (size, size + 1) if left_is_smaller else (size + 1, size)
        fewer = rows[spans[smaller, 0] : spans[smaller, 1]]
        tallies[smaller], tallies[larger] = pass_on(tallies[node], fewer, len(mine), sample, pool)
        waiting.append(larger)
        waiting.append(smaller)  # which is grown first
        size += 2
    return _level_by_level(nodes[:size], chosen[:size], moments[:size])


@compiled
def _level_by_level(
    nodes: NDArray[np.int32], chosen: Ints, moments: NDArray[np.float64]
) -> tuple[NDArray[np.int32], Ints, NDArray[np.float64]]:
    """Put the nodes of a tree in the order of their distance from the root: what is often asked lies close together."""
    order, n = np.zeros(len(nodes), np.int64), 1
    left = np.full(len(nodes), -1, np.int32)
    for k in range(len(nodes)):
        child = nodes[order[k], 1]
        if child >= 0:
            order[n], order[n + 1] = child, child + 1
            left[k] = n
            n += 2
    sorted_nodes = nodes[order]
    sorted_nodes[:, 1] = left
    return sorted_nodes, chosen[order], moments[order]


@compiled
def _moments(targets: NDArray[np.float64], times: Ints) -> tuple[float, float, float]:
    """Return mean, count and mean squared error; the last is exactly 0 when all targets are the same."""
    count, total = 0, 0.0
    for i in range(len(targets)):
        count += times[i]
        total += times[i] * (targets[i] - targets[0])
    shift, squares = total / count, 0.0
    for i in range(len(targets)):
        squares += times[i] * (targets[i] - targets[0] - shift) ** 2
    return targets[0] + shift, float(count), squares / count


@compiled
def part(mine: Ints, places: NDArray[np.uint16], cut: int) -> int:
    """Sort rows in place, those up to the cut first, each side in its order; return how many these are."""
    right = np.empty(len(mine), np.int64)
    n_left = n_right = 0
    for row in mine:
        if places[row] <= cut:
            mine[n_left] = row
            n_left += 1
        else:
            right[n_right] = row
            n_right += 1
    mine[n_left:] = right[:n_right]
    return n_left
