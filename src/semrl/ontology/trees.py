"""Regression trees that foresee: exact where the world follows rules, which networks only come near to.

Things in a game move by rules with sharp borders: a ball turns back where it meets a paddle and nowhere else. Trees
find such borders. Several forests, each grown from its own draw of what was lived (bagging, Breiman 1996), agree where
much was lived; where they do not, a plan should not trust one of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numba
import numpy as np
from numpy.typing import NDArray

from semrl.arrays import Arrays
from semrl.ontology.cart import bins_of, grow_tree
from semrl.types import NO_ACTION, Floats, Ints


@dataclass(frozen=True, kw_only=True, slots=True)
class Tree:
    """One regression tree, node by node, the root first.

    Attributes
    ----------
    columns, left
        ``(m,)`` int64: which number decides, and the left child, whose sibling comes after it; both −1 in leaves.
    cuts, means
        ``(m,)`` float32: at and below which it goes left, and what a leaf predicts.
    rows, errors
        ``(m,)`` float32: how many rows it was grown from, and their mean squared error.
    """

    columns: Ints
    left: Ints
    cuts: Floats
    means: Floats
    rows: Floats
    errors: Floats


Trees = tuple[NDArray[Any], Ints]
"""Packed nodes and roots; see `Forests`."""

_NODE = np.dtype([("column", "i4"), ("left", "i4"), ("cut", "f4"), ("mean", "f4")])
"""What is asked of a node, side by side in memory: apart it took half as long again."""


class Forests:
    """Regression trees for every number to be predicted, several of each.

    Parameters
    ----------
    members
        Forests.
    """

    def __init__(self, members: int) -> None:
        self.members = members
        self._nodes = np.zeros((0, 2), np.int32)  # (k, 2): feature, left child; both −1 in leaves
        self._numbers = np.zeros((0, 2), np.float32)  # (k, 2): cut, value
        self._roots = np.zeros((members, 0), np.int64)  # (members, targets)
        self._support = np.zeros((0, 2), np.float32)  # (k, 2): rows, mean squared error
        self._pack()

    def fit(
        self,
        rows: Floats,
        wanted: NDArray[np.float64],
        rng: np.random.Generator,
        *,
        leaf_rows: Sequence[int],
        unseen: int | None = None,
    ) -> Self:
        """Grow trees for each column of ``(n, k)`` wanted numbers from ``(n, d)`` rows.

        A single forest learns from all rows, each of several from as many rows drawn with replacement. A tree's leaf
        has at least its number of ``leaf_rows``, ``(k,)``. The last tree does not look at the column ``unseen``.
        """
        places, cuts = bins_of(rows)
        last = wanted.shape[1] - 1
        hidden = places.copy()
        if unseen is not None:
            hidden[unseen] = 0
        nodes, numbers, support, size = [], [], [], 0
        self._roots = np.zeros((self.members, wanted.shape[1]), np.int64)
        for member, target in np.ndindex(self._roots.shape):
            if target == 0:
                drawn = rng.integers(len(rows), size=len(rows)) if self.members > 1 else np.arange(len(rows))
            column = np.ascontiguousarray(wanted[:, target], np.float64)
            tree, values, rows_of = grow_tree(
                hidden if target == last else places, cuts, column, drawn, leaf_rows[target]
            )
            tree[:, 1] += np.where(tree[:, 0] >= 0, size, 0).astype(np.int32)
            self._roots[member, target] = size
            nodes.append(tree)
            numbers.append(values)
            support.append(rows_of)
            size += len(tree)
        self._nodes = np.concatenate(nodes)
        self._numbers, self._support = np.concatenate(numbers), np.concatenate(support)
        self._pack()
        return self

    def tree(self, target: int) -> Tree:
        """Return the first forest's tree for one of the predicted numbers."""
        begin = self._roots[0, target]
        end = np.append(self._roots.ravel(), len(self._nodes))[target + 1]
        nodes = self._nodes[begin:end].astype(np.int64)
        nodes[:, 1] -= np.where(nodes[:, 0] >= 0, begin, 0)
        (cuts, means), (rows, errors) = self._numbers[begin:end].T, self._support[begin:end].T
        return Tree(columns=nodes[:, 0], left=nodes[:, 1], cuts=cuts, means=means, rows=rows, errors=errors)

    def __call__(self, rows: Floats) -> Floats:
        """Return what each forest predicts, ``(members, b, k)``, for ``(b, d)`` rows."""
        return np.asarray(_ask((self._packed, self._roots), np.ascontiguousarray(rows, np.float32)))

    def roll(self, states: Floats, actions: Floats, sequences: Ints) -> tuple[Floats, Floats, Floats]:
        """Roll sequences of actions forward in every forest.

        Of a forest's trees the last but one predicts the reward, the last what is expected beyond a scenario.

        Parameters
        ----------
        states, actions
            ``(h, d)`` and ``(p,)`` of the past, the newest first.
        sequences
            ``(s, t)``.

        Returns
        -------
        tuple
            ``(s, t, d)`` states that the first forest foresees; ``(members, s, t)`` rewards; ``(members, s)`` returns
            expected beyond. After its first reward a scenario stands still and is worth no more: what follows is
            another rally, of which little is known.
        """
        return _roll((self._packed, self._roots), states, actions, sequences)

    def to_arrays(self) -> Arrays:
        """Return the trees."""
        return {"nodes": self._nodes, "numbers": self._numbers, "roots": self._roots, "support": self._support}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over trees."""
        self._nodes, self._numbers = arrays["nodes"], arrays["numbers"]
        self._roots, self._support = arrays["roots"], arrays["support"]
        self._pack()

    def _pack(self) -> None:
        self._packed = np.empty(len(self._nodes), _NODE)
        self._packed["column"], self._packed["left"] = self._nodes.T
        self._packed["cut"], self._packed["mean"] = self._numbers.T


def action_column(dimension: int, past_states: int) -> int:
    """Return in which column of `lay_out` the action stands."""
    return dimension * (past_states + dimension)


@numba.njit(cache=True)
def lay_out(states: Floats, actions: Ints, chosen: Ints) -> Floats:
    """Lay out what trees see of many moments, ``(n, f)``; see `_lay_out`.

    Parameters
    ----------
    states, actions
        ``(n, h, d)`` and ``(n, p)``, the newest first.
    chosen
        ``(n,)`` actions.
    """
    n, past, dimension = states.shape
    rows = np.empty((n, _width(dimension, past, actions.shape[1])), np.float32)
    for i in range(n):
        _lay_out(states[i], actions[i], chosen[i], rows[i])
    return rows


@numba.njit(cache=True)
def _width(dimension: int, past_states: int, past_actions: int) -> int:
    return dimension * (past_states + 1) + dimension * (dimension - 1) + 1 + past_actions


@numba.njit(cache=True)
def _lay_out(states: Floats, actions: Floats, chosen: int, row: Floats) -> None:
    """Write the state, how it changed from decision to decision, how its numbers relate, and the actions.

    A tree compares one number with a cut at a time, so "the ball is below the paddle" must be one number: the
    differences of all pairs, now and after as much change again.
    """
    past, dimension = states.shape
    at = 0
    for i in range(dimension):
        row[at] = states[0, i]
        row[at + dimension] = 2 * states[0, i] - states[1, i]
        at += 1
    at += dimension
    for h in range(past - 1):
        for i in range(dimension):
            row[at] = states[h, i] - states[h + 1, i]
            at += 1
    for i in range(dimension):
        for j in range(i + 1, dimension):
            row[at] = states[0, i] - states[0, j]
            row[at + 1] = row[dimension + i] - row[dimension + j]
            at += 2
    row[at] = chosen
    for k in range(len(actions)):
        row[at + 1 + k] = actions[k]


@numba.njit(cache=True)
def _descend(nodes: NDArray[Any], root: int, row: Floats) -> float:
    node = nodes[root]
    while node.column >= 0:
        node = nodes[node.left + (row[node.column] > node.cut)]
    return float(node.mean)


@numba.njit(cache=True)
def _ask(trees: Trees, rows: Floats) -> Floats:
    nodes, roots = trees
    told = np.empty((roots.shape[0], len(rows), roots.shape[1]), np.float32)
    for member in range(roots.shape[0]):
        for i in range(len(rows)):
            for k in range(roots.shape[1]):
                told[member, i, k] = _descend(nodes, roots[member, k], rows[i])
    return told


@numba.njit(cache=True)
def _roll(trees: Trees, states: Floats, actions: Floats, sequences: Ints) -> tuple[Floats, Floats, Floats]:
    nodes, roots = trees
    members, dimension = roots.shape[0], roots.shape[1] - 2
    n, length = sequences.shape
    foreseen = np.empty((n, length, dimension), np.float32)
    rewards, values = np.zeros((members, n, length), np.float32), np.zeros((members, n), np.float32)
    row = np.empty(_width(dimension, len(states), len(actions)), np.float32)
    following = np.empty(dimension, np.float32)
    for member in range(members):
        for s in range(n):
            window, past = states.copy(), actions.copy()
            over = False
            for t in range(length):
                if not over:
                    _lay_out(window, past, sequences[s, t], row)
                    for i in range(dimension):
                        following[i] = window[0, i] + _descend(nodes, roots[member, i], row)
                    reward = np.rint(_descend(nodes, roots[member, dimension], row))
                    rewards[member, s, t] = reward
                    over = reward != 0
                    _push(window, following)
                    if len(past):
                        past[1:] = past[:-1].copy()
                        past[0] = sequences[s, t]
                if member == 0:
                    foreseen[s, t] = window[0]
            if not over:
                _lay_out(window, past, NO_ACTION, row)
                values[member, s] = _descend(nodes, roots[member, dimension + 1], row)
    return foreseen, rewards, values


@numba.njit(cache=True)
def _push(window: Floats, state: Floats) -> None:
    """Put a state before the others, of which the last goes."""
    for h in range(len(window) - 1, 0, -1):
        window[h] = window[h - 1]
    window[0] = state
