"""Which cut of a regression tree's node explains most, in compiled code.

The rows of a node are tallied by bin: how many there are, and the sum of their targets. A large node's tally
need not be made of its rows: it is its parent's less its sibling's, so that only the smaller of two siblings is looked
at (Ke et al., "LightGBM", NeurIPS 2017). Trees that peel off a few rows at a time, as those of a game do, grow several
times faster so. It is done where sums are exact, so that the same tree comes of it.
"""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.kernels import compiled, vectorised

MAX_BINS = 512
NONE = -1
"""Stands for no tally."""
_FEW = 8  # bins a row above which only those that are not empty are looked at
_FEWEST_TALLIED = 64  # rows

Sample = tuple[NDArray[np.uint16], Ints, NDArray[np.float64], Ints]
"""Of each row its bins, ``(d, n)``, its target times how many times it counts, ``(n,)``, and these times,
``(n,)``; second, ``(d + 1,)``, where the bins of each column begin among those of all."""

Bins = tuple[NDArray[np.int32], NDArray[np.float64]]
"""How many rows there are in each of some bins, and the sum of their targets."""

Pool = tuple[NDArray[np.int32], NDArray[np.float64], list[int]]
"""Tallies, ``(tallies, bins)`` of both kinds, and which of them are free."""


@compiled
def sums_are_exact(targets: NDArray[np.float64], times: Ints) -> bool:
    """Tell whether any order of adding and taking away gives the same sum, to the last bit: whole numbers."""
    whole = (targets == np.rint(targets)).all()
    return bool(whole and (np.abs(targets) * times).sum() < 2.0**53)


@compiled
def new_pool(n_rows: int, n_bins: int) -> Pool:
    """Make as many tallies as there can be at once where the smaller of two children comes first."""
    depth = 1
    while _FEWEST_TALLIED << depth <= n_rows:
        depth += 1
    return np.zeros((depth, n_bins), np.int32), np.zeros((depth, n_bins)), [*range(depth)]


@compiled
def begin_tally(mine: Ints, sample: Sample, pool: Pool) -> int:
    """Tally rows; return which tally theirs is, −1 where they are too few."""
    if len(mine) < _FEWEST_TALLIED:
        return NONE
    counts, sums, free = pool
    tally = free.pop()
    counts[tally] = 0
    sums[tally] = 0.0
    _add(int(np.int64(1)), mine, sample, (counts[tally], sums[tally]))
    return tally


@compiled
def give_back(tally: int, pool: Pool) -> None:
    """Say that a tally is no longer needed."""
    if tally != NONE:
        pool[2].append(tally)


@compiled
def pass_on(tally: int, fewer: Ints, n_rows: int, sample: Sample, pool: Pool) -> tuple[int, int]:
    """Return the tallies of the smaller child, which has the rows ``fewer``, and of the larger, made of the parent's.

    Both together have ``n_rows``. The smaller child's subtree must be grown before the larger's.
    """
    if tally == NONE:
        return NONE, NONE
    if n_rows - len(fewer) < _FEWEST_TALLIED:
        give_back(tally, pool)
        return NONE, NONE
    counts, sums, _ = pool
    smaller = begin_tally(fewer, sample, pool)
    if smaller == NONE:
        _add(int(np.int64(-1)), fewer, sample, (counts[tally], sums[tally]))
    else:
        counts[tally] -= counts[smaller]
        sums[tally] -= sums[smaller]
    return smaller, tally


@compiled
def best_cut(mine: Ints, tally: int, sample: Sample, pool: Pool, leaf_rows: int) -> tuple[int, int]:
    """Return the column and the bin after which to cut for the smallest squared error; −1 where no cut helps."""
    places, begins, weighted, times = sample
    mine_weighted, mine_times = weighted[mine], times[mine]  # side by side in memory, as they are read
    n, total = int(np.int64(0)), 0.0  # typed, or what is called is compiled for the literal as well
    for i in range(len(mine)):
        n += mine_times[i]
        total += mine_weighted[i]
    best, found, after = total * total / n + 1e-9, -1, -1
    whole, room = (n, total), np.empty((3, MAX_BINS))
    here = np.zeros(MAX_BINS, np.int32), np.zeros(MAX_BINS)
    for column in range(len(places)):
        begin, end = begins[column], begins[column + 1]
        if tally != NONE:
            bins = pool[0][tally, begin:end], pool[1][tally, begin:end]
            best, place = _best_place(bins, whole, best, leaf_rows, room)
        elif _FEW * len(mine) < end - begin:
            filled, bins = _tally_few(mine, column, sample, here)
            best, place = _best_place(bins, whole, best, leaf_rows, room)
            place = filled[place] if place >= 0 else place
        else:
            bins = here[0][: end - begin], here[1][: end - begin]
            for i in range(len(mine)):
                bins[0][places[column, mine[i]]] += mine_times[i]
                bins[1][places[column, mine[i]]] += mine_weighted[i]
            best, place = _best_place(bins, whole, best, leaf_rows, room)
            bins[0][:] = 0
            bins[1][:] = 0.0
        if place >= 0:
            found, after = column, place
    return found, after


@vectorised
def _best_place(
    bins: Bins, whole: tuple[int, float], best: float, leaf_rows: int, room: NDArray[np.float64]
) -> tuple[float, int]:
    """Return what the best cut of a column explains and after which bin it is; −1 where none exceeds what is best."""
    (counts, sums), (n, total), (left, left_sums, explained) = bins, whole, (room[0], room[1], room[2])
    so_far, sum_so_far, first, last = 0, 0.0, 0, 0
    for place in range(len(counts)):
        so_far += counts[place]
        sum_so_far += sums[place]
        left[place], left_sums[place] = so_far, sum_so_far
    for place in range(len(counts)):
        first += left[place] < leaf_rows
        last += left[place] <= n - leaf_rows
    for place in range(first, last):  # after an empty bin it is the same as before, and the first of equals counts
        rest = total - left_sums[place]
        explained[place] = left_sums[place] * left_sums[place] / left[place] + rest * rest / (n - left[place])
    after = -1
    for place in range(first, last):
        if explained[place] > best:
            best, after = explained[place], place
    return best, after


@compiled
def _tally_few(mine: Ints, column: int, sample: Sample, here: Bins) -> tuple[Ints, Bins]:
    """Tally rows of one column; return the bins that are not empty, ascending, and what they hold."""
    (places, _, weighted, times), (counts, sums) = sample, here
    filled, n = np.empty(len(mine), np.int64), 0
    for row in mine:
        place = places[column, row]
        if counts[place] == 0:
            at = n
            while at > 0 and filled[at - 1] > place:
                filled[at] = filled[at - 1]
                at -= 1
            filled[at] = place
            n += 1
        counts[place] += times[row]
        sums[place] += weighted[row]
    filled = filled[:n]
    bins = counts[filled], sums[filled]
    for place in filled:
        counts[place] = 0
        sums[place] = 0.0
    return filled, bins


@compiled
def _add(sign: int, mine: Ints, sample: Sample, bins: Bins) -> None:
    """Add rows to a tally, or take them away."""
    (places, begins, weighted, times), (counts, sums) = sample, bins
    mine_weighted, mine_times = sign * weighted[mine], sign * times[mine]
    for column in range(len(places)):
        begin = begins[column]
        for i in range(len(mine)):
            counts[begin + places[column, mine[i]]] += mine_times[i]
            sums[begin + places[column, mine[i]]] += mine_weighted[i]
