"""What trees see, and how they are asked, in compiled code.

Everything is done for many rows at once, which stand in columns, the *lanes*: numbers of one kind lie side by side,
so they are laid out several at a time, and while one lane waits for memory others descend.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.world_model.nearest import NEAREST, Nearest, lay_out_nearest

Trees = tuple[NDArray[Any], Ints]
"""``(k,)`` of `NODE` and ``(members, targets)`` roots among them."""


class Relations(NamedTuple):
    """Which numbers are compared with which."""

    pairs: Ints
    """``(m, 2)`` numbers that are compared."""
    distances: bool
    """Whether by how far they lie apart as well."""
    nearest: Nearest
    """The things that are compared with what is nearest to them."""


NODE = np.dtype([("column", "i4"), ("left", "i4"), ("cut", "f4"), ("mean", "f4")])
"""What is asked of a node, side by side in memory: apart it took half as long again."""


@compiled
def lay_out(states: Floats, actions: Ints, chosen: Ints, relations: Relations) -> Floats:
    """Lay out what trees see of many histories, ``(n, f)``, each column in one piece; see `lay_out_lanes`.

    Parameters
    ----------
    states, actions
        ``(n, h, d)`` and ``(n, p)``, the newest first.
    chosen
        ``(n,)`` actions.
    relations
        Which numbers are compared.
    """
    n, past, dimension = states.shape
    rows = np.empty((width(dimension, past, actions.shape[1], relations), n), np.float32)
    lanes, before = np.empty((past, dimension, n), np.float32), np.empty((actions.shape[1], n), np.float32)
    for row in range(n):
        lanes[:, :, row], before[:, row] = states[row], actions[row]
    lay_out_lanes((lanes, 0), before, chosen.astype(np.float32), rows, n, relations)
    return rows.T


@compiled
def ask(trees: Trees, rows: Floats) -> Floats:
    """Return what each forest predicts, ``(members, b, k)``, for ``(f, b)`` lanes."""
    members, n = trees[1].shape[0], rows.shape[1]
    alike = np.empty((members, *rows.shape), np.float32)
    alike[:] = rows
    predicted = np.empty((members, trees[1].shape[1], n), np.float32)
    descend(trees, alike, np.full(members, n), predicted)
    return predicted.transpose(0, 2, 1)


@compiled
def width(dimension: int, past_states: int, past_actions: int, relations: Relations) -> int:
    """Return how many numbers `lay_out` makes of one decision."""
    pairs, distances, nearest = relations
    compared = len(pairs) * (4 if distances else 2) + len(nearest.columns) * NEAREST
    return dimension * (past_states + 1) + compared + 1 + past_actions


@compiled
def lay_out_lanes(  # noqa: PLR0917
    states: tuple[Floats, int], actions: Floats, chosen: Floats, rows: Floats, n: int, relations: Relations
) -> None:
    """Write the state, how it changed from decision to decision, how its numbers relate, and the actions.

    A tree compares one number with a cut at a time, so "the ball is below the paddle" must be one number: the
    differences of pairs, now and after as much change again. "It touches the paddle" is one number only as a
    distance; and where there are many things, what any of them does to others is one rule only about the nearest.
    Of the first ``n`` lanes of ``(h, d, …)`` states in a ring, of which the newest has its place, ``(p, …)`` actions
    before and ``(…)`` actions now it makes ``(f, …)`` rows.
    """
    (ring, newest), (pairs, distances, things) = states, relations
    past, dimension, _ = ring.shape
    for i in range(dimension):
        now, then, row, after = ring[newest, i], ring[(newest + 1) % past, i], rows[i], rows[dimension + i]
        for s in range(n):
            row[s] = now[s]
            after[s] = 2 * now[s] - then[s]
    at = 2 * dimension
    for h in range(newest, newest + past - 1):
        for i in range(dimension):
            now, then, row = ring[h % past, i], ring[(h + 1) % past, i], rows[at]
            for s in range(n):
                row[s] = now[s] - then[s]
            at += 1
    for i, j in pairs:
        for later in (0, 1):
            one, other, row = rows[later * dimension + i], rows[later * dimension + j], rows[at + later]
            apart = rows[at + later + 2 * distances]
            for s in range(n):
                row[s] = one[s] - other[s]
                if distances:
                    apart[s] = abs(row[s])
        at += 4 if distances else 2
    if len(things.columns):
        lay_out_nearest(things, rows, at, n, dimension)
        at += len(things.columns) * NEAREST
    rows[at, :n] = chosen[:n]
    rows[at + 1 :, :n] = actions[:, :n]


_TOGETHER = 64
"""Lanes that go down a tree together, a bit each."""


@compiled
def descend(trees: Trees, rows: Floats, counts: Ints, predicted: Floats) -> None:
    """Write what each tree predicts, ``(m, k, …)``, for the lanes of its forest, ``(m, f, …)``, as many as it has.

    Lanes go down together for as long as they go the same way, which they do where a tree asks for nothing that an
    action has had an effect on. A way waits for memory at each node, so all ways go on side by side, a level at a time.
    Numbers that count are unsigned, as signed ones are asked each time whether they count from the end.
    """
    (nodes, roots), (_, columns, lanes), (_, targets, places) = trees, rows.shape, predicted.shape
    numbers, outputs = rows.reshape(-1), predicted.reshape(-1)
    at, next_at, of, next_of, who, next_who = _ways(roots, counts)
    left, groups = _begun(roots, counts, (at, of, who), (columns * lanes, targets * places, places))
    while left:
        following = np.uint64(0)
        for way in range(left):
            node, group, members = nodes[at[way]], of[way], who[way]
            first, output, n = groups[group]
            if node.column < 0:
                for s in range(n):
                    if (members >> np.uint64(s)) & np.uint64(1):
                        outputs[output + s] = node.mean
                continue
            row, right, cut = np.uint64(first + node.column * lanes), np.uint64(0), node.cut
            for s in range(np.uint64(n)):
                right |= np.uint64(numbers[row + s] > cut) << s
            for side, some in ((0, members & ~right), (1, members & right)):
                next_at[following], next_of[following], next_who[following] = node.left + side, group, some
                following += np.uint64(some != 0)
        at, next_at, of, next_of, who, next_who = next_at, at, next_of, of, next_who, who
        left = int(np.int64(following))


@compiled
def _ways(roots: Ints, counts: Ints) -> tuple[Ints, Ints, Ints, Ints, NDArray[np.uint64], NDArray[np.uint64]]:
    """Return room for as many ways as there can be, twice: where each is, of which group, and which lanes go it."""
    most = counts.sum() * roots.shape[1] + 1
    at, of, who = np.empty((2, most), np.int64), np.empty((2, most), np.int64), np.empty((2, most), np.uint64)
    return at[0], at[1], of[0], of[1], who[0], who[1]


@compiled
def _begun(
    roots: Ints, counts: Ints, ways: tuple[Ints, Ints, NDArray[np.uint64]], steps: tuple[int, int, int]
) -> tuple[int, Ints]:
    """Let a way begin at each root for every group of a forest's lanes; return how many there are, and the groups.

    Of each group, ``(g, 3)``: where its numbers and its outputs begin, and how many lanes it has.
    """
    (at, of, who), (row_step, output_step, target_step), group = ways, steps, 0
    groups = np.empty((roots.shape[1] * (counts // _TOGETHER + 1).sum(), 3), np.int64)
    for member in range(roots.shape[0]):
        for k in range(roots.shape[1]):
            for first in range(0, counts[member], _TOGETHER):
                n = min(counts[member] - first, _TOGETHER)
                groups[group] = member * row_step + first, member * output_step + k * target_step + first, n
                at[group], of[group] = roots[member, k], group
                who[group] = np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(_TOGETHER - n)
                group += 1
    return group, groups
