"""Regression trees that foresee: exact where the world follows rules, which networks only come near to.

Things in a game move by rules with sharp borders: a ball turns back where it meets a paddle and nowhere else. Trees
find such borders. Several forests, each grown from its own draw of what was lived (bagging, Breiman 1996), agree where
much was lived; where they do not, a plan should not trust one of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semrl.arrays import Arrays
from semrl.ontology.cart import bins_of, grow_tree
from semrl.ontology.tree_kernels import NODE, ask, roll
from semrl.types import Floats, Ints


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
        return np.asarray(ask((self._packed, self._roots), np.ascontiguousarray(rows.T, np.float32)))

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
        return roll((self._packed, self._roots), states, actions, sequences)

    def to_arrays(self) -> Arrays:
        """Return the trees."""
        return {"nodes": self._nodes, "numbers": self._numbers, "roots": self._roots, "support": self._support}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over trees."""
        self._nodes, self._numbers = arrays["nodes"], arrays["numbers"]
        self._roots, self._support = arrays["roots"], arrays["support"]
        self._pack()

    def _pack(self) -> None:
        self._packed = np.empty(len(self._nodes), NODE)
        self._packed["column"], self._packed["left"] = self._nodes.T
        self._packed["cut"], self._packed["mean"] = self._numbers.T


def action_column(dimension: int, past_states: int) -> int:
    """Return in which column of `lay_out` the action stands."""
    return dimension * (past_states + dimension)
