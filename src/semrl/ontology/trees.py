"""Regression trees: exact where the world follows rules, which networks only come near to.

Coordinates in a game change by rules with sharp borders: a ball turns back where it meets a paddle and nowhere else.
CART trees (Breiman et al. 1984) find such borders. They are fitted by scikit-learn and asked in compiled code: a plan
asks for hundreds of rows, a few at a time.
"""

from abc import ABC, abstractmethod
from typing import Any, Self

import numba
import numpy as np
from numpy.typing import NDArray
from sklearn.tree import DecisionTreeRegressor

from semrl.arrays import Arrays, nest, unnest
from semrl.errors import UsageError
from semrl.ontology.network import features
from semrl.types import Floats, Ints, Transitions

MAX_DIMENSION = 32
"""Longest state that trees are fitted to; they look at all pairs of numbers."""
GROWTH = 1.1
"""Trees are fitted anew when there is so many times as much to learn from."""


def relational_features(states: Floats, previous: Floats, actions: Ints, n_actions: int) -> Floats:
    """Lay out what trees see: state, difference, action, and how numbers relate, now and after as much change again.

    A tree compares one number with a threshold at a time, so "the ball is below the paddle" must be one number.
    """
    first, second = np.triu_indices(states.shape[1], k=1)
    ahead = 2 * states - previous  # where everything is if it goes on like this
    relations = [states[:, first] - states[:, second], ahead, ahead[:, first] - ahead[:, second]]
    return np.concatenate([features(states, previous, actions, n_actions), *relations], axis=1, dtype=np.float32)


class Forest:
    """One regression tree for each number to be predicted, as arrays.

    Parameters
    ----------
    leaf_decisions
        Fewest rows in a leaf.
    """

    def __init__(self, leaf_decisions: int) -> None:
        self.leaf_decisions = leaf_decisions
        self._nodes = np.zeros((0, 3), np.int64)  # (k, 3): feature, left child, right child; −1 in leaves
        self._numbers = np.zeros((0, 2))  # (k, 2): threshold, value
        self._roots = np.zeros(0, np.int64)

    def fit(self, rows: Floats, wanted: NDArray[Any]) -> Self:
        """Grow a tree for each column of ``(n, k)`` wanted numbers from ``(n, d)`` rows."""
        nodes, numbers, roots, size = [], [], [], 0
        for column in wanted.T:
            tree = DecisionTreeRegressor(min_samples_leaf=self.leaf_decisions, random_state=0).fit(rows, column).tree_
            children = np.stack([tree.children_left, tree.children_right], axis=1)
            children = np.where(children >= 0, children + size, -1)
            nodes.append(np.column_stack([np.where(children[:, 0] >= 0, tree.feature, -1), children]))
            numbers.append(np.column_stack([tree.threshold, tree.value[:, 0, 0]]))
            roots.append(size)
            size += tree.node_count
        self._nodes, self._numbers = np.concatenate(nodes).astype(np.int64), np.concatenate(numbers)
        self._roots = np.array(roots, np.int64)
        return self

    def __call__(self, rows: Floats) -> NDArray[np.float64]:
        """Return what the trees predict, ``(b, k)``, for ``(b, d)`` rows."""
        return np.asarray(_descend(self._nodes, self._numbers, self._roots, np.ascontiguousarray(rows)))

    def to_arrays(self) -> Arrays:
        """Return the trees."""
        return {"nodes": self._nodes, "numbers": self._numbers, "roots": self._roots}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over trees."""
        self._nodes, self._numbers, self._roots = (arrays[name] for name in ("nodes", "numbers", "roots"))


class Memory:
    """The newest decisions, from which trees are grown, and how many there were at the last growing.

    Parameters
    ----------
    capacity
        Decisions kept, oldest first to go.
    dimension
        Length of a state.

    Raises
    ------
    UsageError
        When states are too long for trees.
    """

    def __init__(self, capacity: int, dimension: int) -> None:
        if dimension > MAX_DIMENSION:
            raise UsageError(
                f"trees learn from states of at most {MAX_DIMENSION} numbers, not {dimension}; use a network"
            )
        self.capacity = capacity
        self.seen_ = 0
        self.fitted_ = 0
        none, nothing = np.zeros((0, dimension), np.float32), np.zeros(0, np.float32)
        self.transitions = Transitions(
            states=none, previous=none, actions=np.zeros(0, np.int64), rewards=nothing, next_states=none
        )

    def add(self, transitions: Transitions) -> bool:
        """Remember decisions; return whether there is enough new to grow trees anew."""
        joined = {
            name: np.concatenate([getattr(self.transitions, name), getattr(transitions, name)])[-self.capacity :]
            for name in Transitions.__dataclass_fields__
        }
        self.transitions = Transitions(**joined)
        self.seen_ += len(transitions)
        if self.seen_ < GROWTH * self.fitted_ or not self.seen_:
            return False
        self.fitted_ = self.seen_
        return True

    def to_arrays(self) -> Arrays:
        """Return all that is remembered."""
        own = {name: getattr(self.transitions, name) for name in Transitions.__dataclass_fields__}
        return own | {"counts": np.array([self.seen_, self.fitted_])}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.transitions = Transitions(**{name: arrays[name] for name in Transitions.__dataclass_fields__})
        self.seen_, self.fitted_ = (int(count) for count in arrays["counts"])


class TreeModel(ABC):
    """A model made of trees, grown anew from all that it remembers whenever there is a tenth more.

    Parameters
    ----------
    dimension
        Length of a state, at most 32.
    n_actions
        Number of actions.
    leaf_decisions
        Fewest decisions in a leaf.
    capacity
        Decisions remembered.
    """

    def __init__(self, dimension: int, n_actions: int, *, leaf_decisions: int, capacity: int) -> None:
        self.dimension = dimension
        self.n_actions = n_actions
        self.forest = Forest(leaf_decisions)
        self.memory = Memory(capacity, dimension)

    @abstractmethod
    def _wanted(self, transitions: Transitions) -> NDArray[Any]:
        """Return what is to be predicted, ``(t, k)``."""

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned yet."""
        return self.memory.fitted_ > 0

    def partial_fit(self, transitions: Transitions) -> Self:
        """Remember some transitions and, when there are enough new ones, grow the trees from all."""
        if self.memory.add(transitions):
            known = self.memory.transitions
            rows = relational_features(known.states, known.previous, known.actions, self.n_actions)
            self.forest.fit(rows, self._wanted(known))
        return self

    def _ask(self, states: Floats, previous: Floats, actions: Ints) -> NDArray[np.float64]:
        return self.forest(relational_features(states, previous, actions, self.n_actions))

    def to_arrays(self) -> Arrays:
        """Return trees and memory."""
        return nest(forest=self.forest.to_arrays(), memory=self.memory.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.forest.from_arrays(unnest(arrays, "forest"))
        self.memory.from_arrays(unnest(arrays, "memory"))


@numba.njit(cache=True)
def _descend(
    nodes: NDArray[np.int64], numbers: NDArray[np.float64], roots: NDArray[np.int64], rows: NDArray[np.float32]
) -> NDArray[np.float64]:
    predicted = np.empty((len(rows), len(roots)))
    for i in range(len(rows)):
        for j in range(len(roots)):
            node = roots[j]
            while nodes[node, 0] >= 0:
                goes_left = rows[i, nodes[node, 0]] <= numbers[node, 0]
                node = nodes[node, 1] if goes_left else nodes[node, 2]
            predicted[i, j] = numbers[node, 1]
    return predicted
