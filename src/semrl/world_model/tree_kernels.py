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
    lanes, before = np.empty((past, dimension, n), np.float32), np.empty((actions.shape[1], n), np.float32)
    for row in range(n):
        lanes[:, :, row], before[:, row] = states[row], actions[row]
    _lay_out(lanes, before, chosen.astype(np.float32), rows[:, :n], relations)
    return rows.T


@compiled
def ask(trees: Trees, rows: Floats) -> Floats:
    """Return what each forest predicts, ``(members, b, k)``, for ``(f, b)`` lanes."""
    nodes, roots = trees
    predicted = np.empty((*roots.shape, rows.shape[1]), np.float32)
    lanes = np.arange(rows.shape[1])
    for member in range(roots.shape[0]):
        _descend((nodes, roots[member : member + 1]), rows, lanes, predicted[member])
    return predicted.transpose(0, 2, 1)


@compiled
def roll(  # noqa: PLR0917 - compiled functions take no keywords
    trees: Trees, inertia: Floats, states: Floats, actions: Floats, sequences: Ints, relations: Relations
) -> tuple[Floats, Floats, Floats]:
    """Roll sequences of actions forward in every forest; see `semrl.world_model.trees.Forests.roll`.

    All forests roll at once: a lane is a sequence in a forest, and those of one sequence lie side by side.
    """
    members, dimension = trees[1].shape[0], trees[1].shape[1] - 2
    n, length = sequences.shape
    begins, origins = branches(sequences)
    order, place_of = _by_time(begins, length)
    begins, origins = begins[order], place_of[origins[order]]
    chosen = np.full((length + 1, n * members), NO_ACTION, np.float32)
    for s in range(n):
        for t in range(length):
            chosen[t, s * members : (s + 1) * members] = sequences[order[s], t]
    predicted = np.empty((n, length, dimension), np.float32)
    rewards, values = np.zeros((members, n, length), np.float32), np.zeros((members, n), np.float32)
    outputs = predicted, rewards, values
    _roll_lanes(trees, inertia, (states, actions), (chosen, begins, origins), outputs, relations)
    for s in range(1, n):
        begin, origin = begins[s], origins[s]
        predicted[s, :begin], rewards[:, s, :begin] = predicted[origin, :begin], rewards[:, origin, :begin]
        if begin == length:
            values[:, s] = values[:, origin]
    return predicted[place_of], rewards[:, place_of], values[:, place_of]


@compiled
def _by_time(begins: Ints, length: int) -> tuple[Ints, Ints]:
    """Return the order in which sequences begin, of equal ones the first first, and each one's place in it."""
    order, place_of = np.empty(len(begins), np.int64), np.empty(len(begins), np.int64)
    place = 0
    for t in range(length + 1):
        for s in range(len(begins)):
            if begins[s] == t:
                order[place], place_of[s] = s, place
                place += 1
    return order, place_of


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
    trees: Trees,
    inertia: Floats,
    past: tuple[Floats, Floats],
    lanes: tuple[Floats, Ints, Ints],
    outputs: tuple[Floats, Floats, Floats],
    relations: Relations,
) -> None:
    """Roll forward, writing the first forest's states, ``(n, t, d)``, rewards, ``(m, n, t)``, and values, ``(m, n)``.

    It is given the action of each lane, ``(t + 1, n·m)``, when each sequence begins, ascending, and which one it leaves
    then.
    """
    (nodes, roots), (states, actions), (chosen, begins, origins) = trees, past, lanes
    predicted, rewards, values = outputs
    (n, length, dimension), members = predicted.shape, len(roots)
    window, before = _repeated(states, n * members), _repeated(actions, n * members)
    rows = np.empty((width(dimension, len(states), len(actions), relations), n * members), np.float32)
    changes, going = np.empty((dimension + 1, n * members), np.float32), np.ones(n * members, np.bool_)
    begun = int(np.int64(1))  # as a mere 1 it would be another type to the function below, compiled for each
    for t in range(length):
        begun = _begin((begun, t), (begins, origins), window, before, going, members)
        known, active = rows[:, : begun * members], np.flatnonzero(going[: begun * members])
        _lay_out(window, before, chosen[t], known, relations)
        _descend((nodes, roots[:, : dimension + 1]), known, active, changes)
        _advance(window, before, chosen[t], inertia, changes, active)
        for lane in active:
            reward = np.rint(changes[dimension, lane])
            rewards[lane % members, lane // members, t], going[lane] = reward, reward == 0
        for s in range(begun):
            for i in range(dimension):
                predicted[s, t, i] = window[0, i, s * members]
    known, active = rows[:, : begun * members], np.flatnonzero(going[: begun * members])
    _lay_out(window, before, chosen[length], known, relations)
    _descend((nodes, roots[:, dimension + 1 :]), known, active, changes)
    for lane in active:
        values[lane % members, lane // members] = changes[0, lane]


@compiled
def _begin(  # noqa: PLR0917
    at: tuple[int, int],
    begin: tuple[Ints, Ints],
    window: Floats,
    before: Floats,
    going: NDArray[np.bool_],
    members: int,
) -> int:
    """Let the lanes of sequences begin whose time has come, like those that they leave; return how many have begun."""
    (begun, t), (begins, origins) = at, begin
    while begun < len(begins) and begins[begun] == t:
        for member in range(members):
            new, old = begun * members + member, origins[begun] * members + member
            window[:, :, new], before[:, new], going[new] = window[:, :, old], before[:, old], going[old]
        begun += 1
    return begun


@compiled
def _repeated(known: Floats, n: int) -> Floats:
    """Return so many lanes of the same numbers."""
    lanes = np.empty((*known.shape, n), np.float32)
    for s in range(n):
        lanes[..., s] = known
    return lanes


@compiled
def _advance(  # noqa: PLR0917
    window: Floats, before: Floats, chosen: Floats, inertia: Floats, changes: Floats, active: Ints
) -> None:
    """Put the next state of active lanes, and what was done, before the others, of which the last goes.

    What goes on by itself changes by its last change and what the trees predict.
    """
    past, dimension, n = window.shape
    for i in range(dimension):
        now, then, change = window[0, i], window[1, i], changes[i]
        if inertia[i]:
            for s in active:
                change[s] += inertia[i] * (now[s] - then[s])
        for h in range(past - 1, 0, -1):
            older, old = window[h, i], window[h - 1, i]
            for s in range(n):
                older[s] = old[s]
        for s in active:
            now[s] += change[s]
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
        now, then, row, after = states[0, i], states[1, i], rows[i], rows[dimension + i]
        for s in range(n):
            row[s] = now[s]
            after[s] = 2 * now[s] - then[s]
    at = 2 * dimension
    for h in range(past - 1):
        for i in range(dimension):
            now, then, row = states[h, i], states[h + 1, i], rows[at]
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
    rows[at] = chosen[:n]
    rows[at + 1 :] = actions[:, :n]


_AT_ONCE = 512
"""Lanes that go down together, each as often as it has trees: while one waits for memory there are others."""


@compiled
def _descend(trees: Trees, rows: Floats, lanes: Ints, predicted: Floats) -> None:
    """Write what each tree predicts for some lanes, ``(k, n)``, which go down together, a level at a time.

    A lane's forest is its number modulo the forests there are. One after the other each step would wait for the one
    before. Numbers that count are unsigned, as signed ones are asked each time whether they count from the end.
    """
    (nodes, roots), n = trees, len(lanes)
    together = max(_AT_ONCE // max(n, 1), 1)  # trees
    at, lane_of = np.empty(together * n, np.uint32), np.empty(together * n, np.uint32)
    going = np.empty(together * n, np.uint32)
    for first in range(0, roots.shape[1], together):
        some = range(first, min(first + together, roots.shape[1]))
        count, left = np.uint64(0), np.uint64(0)
        for k in some:
            for lane in lanes:
                root = roots[lane % len(roots), k]
                at[count], lane_of[count], going[left] = root, lane, count
                left += np.uint64(nodes[root].column >= 0)
                count += np.uint64(1)
        while left:
            inner = np.uint64(0)
            for i in range(left):
                one = np.uint64(going[i])
                node = nodes[np.uint64(at[one])]
                right = rows[np.uint64(node.column), np.uint64(lane_of[one])] > node.cut
                below = np.uint64(node.left + np.int32(right))
                at[one] = below
                going[inner] = one  # it stays in the list unless this is a leaf: to ask would be to guess wrong often
                inner += np.uint64(nodes[below].column >= 0)
            left = inner
        count = np.uint64(0)
        for k in some:
            for lane in lanes:
                predicted[k, lane] = nodes[np.uint64(at[count])].mean
                count += np.uint64(1)
