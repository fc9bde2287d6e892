"""Regression trees that predict: exact where the world follows rules, which networks only come near to.

Things in a game move by rules with sharp borders: a ball turns back where it meets a paddle and nowhere else. Trees
find such borders. Several forests, each grown from its own draw of the play (bagging, Breiman 1996), agree where
there was much play; where they do not, a plan should not trust one of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.beside import Started
from semrl.world_model.cart import bins_of, grow_tree
from semrl.world_model.experience import EVERY_REWARD
from semrl.world_model.switching import SwitchedOff, without_rules
from semrl.world_model.tree_kernels import NODE, Relations, ask
from semrl.world_model.tree_rolling import roll


@dataclass(frozen=True, kw_only=True, slots=True)
class Tree:
    """One regression tree, node by node, the root first."""

    columns: Ints
    left: Ints
    """``(m,)`` int64: which number decides, and the left child, whose sibling comes after it; both −1 in leaves."""
    cuts: Floats
    means: Floats
    """``(m,)`` float32: at and below which it goes left, and what a leaf predicts."""
    rows: Floats
    errors: Floats
    """``(m,)`` float32: how many rows it was grown from, and their mean squared error."""


class OtherRows(NamedTuple):
    """Other rows that some trees learn from."""

    columns: Sequence[int]
    """Which of the targets."""
    rows: Floats
    """``(n, d)``, as many as all others."""
    targets: NDArray[np.float64]
    """``(n, len(columns))``."""


class Forests:
    """Regression trees for every number to be predicted, several of each.

    Parameters
    ----------
    members
        Forests.
    """

    def __init__(self, members: int) -> None:
        self.members = members
        self._grown = [_Forest.empty() for _ in range(members)]
        self._off: tuple[SwitchedOff, ...] = ()
        self._pack()

    def fit(
        self,
        rows: Floats,
        targets: NDArray[np.float64],
        rng: np.random.Generator,
        *,
        leaf_rows: Sequence[int],
        hidden_column: int | None = None,
        member: int | None = None,
        other: OtherRows | None = None,
    ) -> Self:
        """Grow trees for each column of ``(n, k)`` targets from ``(n, d)`` rows: those of a member, or all.

        A single forest learns from all rows, each of several from as many rows drawn with replacement. A tree's leaf
        has at least its number of ``leaf_rows``, ``(k,)``. The last tree does not look at ``hidden_column``.
        Where all are grown, no rule is switched off any more: the columns may be others. Some may learn from other
        rows than the rest.
        """
        if member is None:
            self._off = ()
        places, cuts = bins_of(rows)
        hidden = places.copy()
        if hidden_column is not None:
            hidden[hidden_column] = 0
        lessons = [(places, cuts, column) for column in _columns(targets)]
        lessons[-1] = hidden, *lessons[-1][1:]
        if other is not None:
            places, cuts = bins_of(other.rows)
            for target, column in zip(other.columns, _columns(other.targets), strict=True):
                lessons[target] = places, cuts, column
        for i in range(self.members) if member is None else (member,):
            drawn = rng.integers(len(rows), size=len(rows)) if self.members > 1 else np.arange(len(rows))
            trees = [
                Started(partial(grow_tree, *lesson, drawn, leaf))
                for lesson, leaf in zip(lessons, leaf_rows, strict=True)
            ]
            last_first = [tree.result() for tree in reversed(trees)]  # from the end on, what has not begun
            self._grown[i] = _Forest.joined(last_first[::-1])
        self._pack()
        return self

    def take_over(self, others: Self, targets: Sequence[int]) -> None:
        """Take the trees for some targets from as many other forests, which have trees for these in their order.

        Rules that are switched off stay so.
        """
        for i, (mine, theirs) in enumerate(zip(self._grown, others._grown, strict=True)):
            trees = [mine.tree(target) for target in range(len(mine.roots))]
            for place, target in enumerate(targets):
                trees[target] = theirs.tree(place)
            self._grown[i] = _Forest.joined(trees)
        self._pack()

    def switch_off(self, rules: Sequence[SwitchedOff]) -> None:
        """Let these rules count for nothing, and all others again; what was grown stays as it is."""
        self._off = tuple(rules)
        self._pack()

    def tree(self, target: int) -> Tree:
        """Return the first forest's tree for one of the predicted numbers."""
        nodes, numbers, support = self._grown[0].tree(target)
        (columns, left), (cuts, means), (rows, errors) = nodes.astype(np.int64).T, numbers.T, support.T
        return Tree(columns=columns, left=left, cuts=cuts, means=means, rows=rows, errors=errors)

    def __call__(self, rows: Floats) -> Floats:
        """Return what each forest predicts, ``(members, b, k)``, for ``(b, d)`` rows."""
        return np.asarray(ask((self._packed, self._roots), np.ascontiguousarray(rows.T, np.float32)))

    def roll(  # noqa: PLR0917 - what is known, in the order of the compiled code
        self,
        inertia: Floats,
        states: Floats,
        actions: Floats,
        sequences: Ints,
        relations: Relations,
        members: slice = slice(None),
        ending: NDArray[np.bool_] = EVERY_REWARD,
    ) -> tuple[Floats, Floats, Floats]:
        """Roll sequences of actions forward in every forest, or some.

        Of a forest's trees the last but one predicts the reward, the last what is expected beyond a scenario.

        Parameters
        ----------
        inertia
            ``(d,)`` share of its last change by which each number goes on by itself; trees predict the rest.
        states, actions
            ``(h, d)`` and ``(p,)`` of the past, the newest first.
        sequences
            ``(s, t)``.
        relations
            Which numbers are compared in what the trees are shown.
        members
            Which forests are asked.
        ending
            ``(2,)``, whether a loss and whether a gain ends a scenario.

        Returns
        -------
        tuple
            ``(s, t, d)`` states that the first of them predicts; ``(members, s, t)`` rewards; ``(members, s)`` returns
            expected beyond. After a reward that ends it a scenario stands still and is worth no more.
        """
        roots, rest = self._roots[members], (inertia, states, actions, sequences, relations, ending)
        if len(roots) < 2:
            return roll((self._packed, roots), *rest)
        others = Started(partial(roll, (self._packed, roots[len(roots) // 2 :]), *rest))
        predicted, rewards, values = roll((self._packed, roots[: len(roots) // 2]), *rest)
        _, more_rewards, more_values = others.result()
        return predicted, np.concatenate([rewards, more_rewards]), np.concatenate([values, more_values])

    def to_arrays(self) -> Arrays:
        """Return the trees."""
        return nest(**{str(i): forest.to_arrays() for i, forest in enumerate(self._grown)})

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over trees; no rule is switched off then."""
        self._off = ()
        self._grown = [_Forest(**unnest(arrays, str(i))) for i in range(self.members)]
        self._pack()

    def _pack(self) -> None:
        """Put all trees side by side, as the compiled code wants them."""
        sizes = [len(forest.nodes) for forest in self._grown]
        begins = np.cumsum([0, *sizes[:-1]])
        self._roots = np.stack([forest.roots + begin for forest, begin in zip(self._grown, begins, strict=True)])
        self._packed = np.empty(sum(sizes), NODE)
        nodes = np.concatenate([forest.nodes for forest in self._grown])
        self._packed["column"] = nodes[:, 0]
        self._packed["left"] = nodes[:, 1] + np.where(nodes[:, 0] >= 0, np.repeat(begins, sizes), 0)
        self._packed["cut"], self._packed["mean"] = np.concatenate([forest.numbers for forest in self._grown]).T
        if self._off:
            self._packed, self._roots = without_rules(self._packed, self._roots, self._off)


@dataclass(frozen=True, kw_only=True, slots=True)
class _Forest:
    """The trees of one forest, one behind the other."""

    nodes: NDArray[np.int32]  # (k, 2): column, left child; both −1 in leaves
    numbers: Floats  # (k, 2): cut, mean
    support: Floats  # (k, 2): rows, mean squared error
    roots: Ints  # (targets,): where each tree begins

    @classmethod
    def empty(cls) -> Self:
        """Make a forest without trees."""
        none = np.zeros((0, 2), np.float32)
        return cls(nodes=none.astype(np.int32), numbers=none, support=none, roots=np.zeros(0, np.int64))

    @classmethod
    def joined(cls, trees: Sequence[tuple[NDArray[np.int32], Floats, Floats]]) -> Self:
        """Put trees one behind the other, as `grow_tree` returns them."""
        roots = np.cumsum([0, *(len(nodes) for nodes, _, _ in trees[:-1])])
        for root, (nodes, _, _) in zip(roots, trees, strict=True):
            nodes[:, 1] += np.where(nodes[:, 0] >= 0, root, 0).astype(np.int32)
        nodes, numbers, support = (np.concatenate(parts) for parts in zip(*trees, strict=True))
        return cls(nodes=nodes, numbers=numbers, support=support, roots=roots)

    def tree(self, target: int) -> tuple[NDArray[np.int32], Floats, Floats]:
        """Return one of them, as `grow_tree` did."""
        begin, end = np.append(self.roots, len(self.nodes))[target : target + 2]
        nodes = self.nodes[begin:end].copy()
        nodes[:, 1] -= np.where(nodes[:, 0] >= 0, begin, 0).astype(np.int32)
        return nodes, self.numbers[begin:end], self.support[begin:end]

    def to_arrays(self) -> Arrays:
        """Return the trees."""
        return {"nodes": self.nodes, "numbers": self.numbers, "support": self.support, "roots": self.roots}


def _columns(targets: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    return [np.ascontiguousarray(column, np.float64) for column in targets.T]
