"""What trees see, and how they are asked, in compiled code.

Everything is done for many rows at once, which stand in columns, the *lanes*: numbers of one kind lie side by side,
so they are laid out several at a time, and while one lane waits for memory others descend.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import NO_ACTION, Floats, Ints
from semrl.core.kernels import compiled

Trees = tuple[NDArray[Any], Ints]
"""``(k,)`` of `NODE` and ``(members, targets)`` roots among them."""

Relations = tuple[Ints, bool]
"""``(m, 2)`` pairs of numbers that are compared, and whether by how far they lie apart as well."""

NODE = np.dtype([("column", "i4"), ("left", "i4"), ("cut", "f4"), ("mean", "f4")])
"""What is asked of a node, side by side in memory: apart it took half as long again."""


@compiled
def lay_out(states: Floats, actions: Ints, chosen: Ints, relations: Relations) -> Floats:
    """Lay out what trees see of many histories, ``(n, f)``, each column in one piece; see `_lay_out`.

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
    _lay_out(states.transpose(1, 2, 0), actions.T, chosen, rows, relations)
    return rows.T


@compiled
def ask(trees: Trees, rows: Floats) -> Floats:
    """Return what each forest predicts, ``(members, b, k)``, for ``(f, b)`` lanes."""
    nodes, roots = trees
    told = np.empty((*roots.shape, rows.shape[1]), np.float32)
    lanes = np.arange(rows.shape[1])
    for member in range(roots.shape[0]):
        _descend(nodes, roots[member], rows, lanes, told[member])
    return told.transpose(0, 2, 1)


@compiled
def roll(  # noqa: PLR0917 - compiled functions take no keywords
    trees: Trees, inertia: Floats, states: Floats, actions: Floats, sequences: Ints, relations: Relations
) -> tuple[Floats, Floats, Floats]:
    """Roll sequences of actions forward in every forest; see `semrl.world_model.trees.Forests.roll`."""
    nodes, roots = trees
    members, dimension = roots.shape[0], roots.shape[1] - 2
    n, length = sequences.shape
    begins, origins = branches(sequences)
    order = np.argsort(begins, kind="mergesort")  # the sequence of each lane: those that have begun come first
    lane_of = np.argsort(order)
    begins, origins = begins[order], lane_of[origins[order]]
    chosen = np.full((length + 1, n), NO_ACTION, np.float32)
    chosen[:length] = sequences[order].T
    predicted = np.empty((n, length, dimension), np.float32)
    rewards, values = np.zeros((members, n, length), np.float32), np.zeros((members, n), np.float32)
    for member in range(members - 1, -1, -1):  # the first one last: what it predicts stays
        told = predicted, rewards[member], values[member]
        _roll_lanes((nodes, roots[member]), inertia, (states, actions), (chosen, begins, origins), told, relations)
    for lane in range(1, n):
        begin, origin = begins[lane], origins[lane]
        predicted[lane, :begin], rewards[:, lane, :begin] = predicted[origin, :begin], rewards[:, origin, :begin]
        if begin == length:
            values[:, lane] = values[:, origin]
    return predicted[lane_of], rewards[:, lane_of], values[:, lane_of]


@compiled
def branches(sequences: Ints) -> tuple[Ints, Ints]:
    """Return for how long each sequence is like one before it, and like which, ``(s,)`` each.

    What sequences have in common is rolled once: by the first of them, which the others leave, each at its time.
    """
    n, length = sequences.shape
    begins, origins, like = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64)
    first = np.empty((n, sequences.max() + 1), np.int64)  # of those that are like this one so far and now act so
    for t in range(length):
        first[:] = -1
        for s in range(n):
            action = sequences[s, t]
            if first[like[s], action] < 0:
                first[like[s], action] = s
            like[s] = first[like[s], action]
            if like[s] != s:
                begins[s], origins[s] = t + 1, like[s]
    return begins, origins


@compiled
def _roll_lanes(  # noqa: PLR0917 - compiled functions take no keywords
    trees: tuple[NDArray[Any], Ints],
    inertia: Floats,
    past: tuple[Floats, Floats],
    lanes: tuple[Floats, Ints, Ints],
    told: tuple[Floats, Floats, Floats],
    relations: Relations,
) -> None:
    """Roll forward in one forest, writing states, ``(n, t, d)``, rewards, ``(n, t)``, and values, ``(n,)``.

    Of lanes it is told the actions, ``(t + 1, n)``, when each begins, ascending, and which one it leaves then.
    """
    (nodes, roots), (states, actions), (chosen, begins, origins) = trees, past, lanes
    predicted, rewards, values = told
    n, length, dimension = predicted.shape
    window, before = _repeated(states, n), _repeated(actions, n)
    columns = width(dimension, len(states), len(actions), relations)
    changes, going = np.empty((dimension + 1, n), np.float32), np.ones(n, np.bool_)
    begun = 1
    for t in range(length):
        while begun < n and begins[begun] == t:
            origin = origins[begun]
            window[:, :, begun], before[:, begun], going[begun] = window[:, :, origin], before[:, origin], going[origin]
            begun += 1
        rows, active = np.empty((columns, begun), np.float32), np.flatnonzero(going[:begun])
        _lay_out(window, before, chosen[t], rows, relations)
        _descend(nodes, roots[: dimension + 1], rows, active, changes)
        _go_on(window, inertia, changes, active)
        _advance(window, before, chosen[t], changes, active)
        for lane in active:
            rewards[lane, t] = np.rint(changes[dimension, lane])
            going[lane] = rewards[lane, t] == 0
        for s in range(begun):
            for i in range(dimension):
                predicted[s, t, i] = window[0, i, s]
    rows = np.empty((columns, begun), np.float32)
    _lay_out(window, before, chosen[length], rows, relations)
    _descend(nodes, roots[dimension + 1 :], rows, np.flatnonzero(going[:begun]), values.reshape(1, n))


@compiled
def _repeated(known: Floats, n: int) -> Floats:
    """Return so many lanes of the same numbers."""
    lanes = np.empty((*known.shape, n), np.float32)
    for s in range(n):
        lanes[..., s] = known
    return lanes


@compiled
def _go_on(window: Floats, inertia: Floats, changes: Floats, active: Ints) -> None:
    """Add to what the trees predict the last change of what goes on by itself."""
    for i in np.flatnonzero(inertia):
        for s in active:
            changes[i, s] += inertia[i] * (window[0, i, s] - window[1, i, s])


@compiled
def _advance(window: Floats, before: Floats, chosen: Floats, changes: Floats, active: Ints) -> None:
    """Put the next state of active lanes, and what was done, before the others, of which the last goes."""
    for h in range(len(window) - 1, 0, -1):
        window[h] = window[h - 1]
    for i in range(window.shape[1]):
        for s in active:
            window[0, i, s] += changes[i, s]
    for h in range(len(before) - 1, 0, -1):
        before[h] = before[h - 1]
    if len(before):
        before[0] = chosen


@compiled
def width(dimension: int, past_states: int, past_actions: int, relations: Relations) -> int:
    """Return how many numbers `lay_out` makes of one decision."""
    pairs, distances = relations
    return dimension * (past_states + 1) + len(pairs) * (4 if distances else 2) + 1 + past_actions


@compiled
def _lay_out(states: Floats, actions: NDArray[Any], chosen: NDArray[Any], rows: Floats, relations: Relations) -> None:
    """Write the state, how it changed from decision to decision, how its numbers relate, and the actions.

    A tree compares one number with a cut at a time, so "the ball is below the paddle" must be one number: the
    differences of pairs, now and after as much change again. "It touches the paddle" is one number only as a
    distance. Of ``(h, d, n)`` states, ``(p, n)`` actions before and ``(n,)`` actions now it makes ``(f, n)`` rows.
    """
    (past, dimension, _), n, (pairs, distances) = states.shape, rows.shape[1], relations
    for i in range(dimension):
        for s in range(n):
            rows[i, s] = states[0, i, s]
            rows[dimension + i, s] = 2 * states[0, i, s] - states[1, i, s]
    at = 2 * dimension
    for h in range(past - 1):
        for i in range(dimension):
            for s in range(n):
                rows[at, s] = states[h, i, s] - states[h + 1, i, s]
            at += 1
    for i, j in pairs:
        for s in range(n):
            rows[at, s] = rows[i, s] - rows[j, s]
            rows[at + 1, s] = rows[dimension + i, s] - rows[dimension + j, s]
        at += 2
        if distances:
            rows[at : at + 2] = np.abs(rows[at - 2 : at])
            at += 2
    rows[at] = chosen[:n]
    rows[at + 1 :] = actions[:, :n]


@compiled
def _descend(nodes: NDArray[Any], roots: Ints, rows: Floats, lanes: Ints, told: Floats) -> None:
    """Write what each tree predicts for some lanes, which go down together, a level at a time.

    One after the other each step would wait for the one before. Numbers that count are unsigned, as signed ones
    are asked each time whether they count from the end.
    """
    at, going = np.empty(rows.shape[1], np.uint64), np.empty(len(lanes), np.uint64)
    for k, root in enumerate(roots):
        at[:], going[:] = root, lanes
        n = len(lanes) if nodes[root].column >= 0 else 0
        while n:
            inner = np.uint64(0)
            for i in range(n):
                lane = going[i]
                node = nodes[at[lane]]
                below = np.uint64(node.left + np.int32(rows[np.uint64(node.column), lane] > node.cut))
                at[lane] = below
                going[inner] = lane  # it stays in the list unless this is a leaf: to ask would be to guess wrong often
                inner += np.uint64(nodes[below].column >= 0)
            n = int(inner)
        for lane in lanes:
            told[k, lane] = nodes[at[lane]].mean
