"""Predicting the sign of a reward (§3.4.3): the thesis's support vector machines, or a small network."""

from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import SGDClassifier
from torch.nn import functional

from semrl.arrays import Arrays, nest, unnest
from semrl.errors import UsageError
from semrl.ontology.network import DenseNetwork, features, spread
from semrl.ontology.trees import Forest, Memory, relational_features
from semrl.types import Floats, Ints, Transitions

SIGNS: Ints = np.array([-1, 0, 1])


@dataclass(frozen=True, kw_only=True, slots=True)
class RewardConfig:
    """Settings of the reward model; the defaults are the thesis's (§3.4.3)."""

    kind: Literal["svm", "network", "trees"] = "svm"
    """Three linear machines, one against all; a network; or a regression tree, for short states."""
    svm_lambda: float = 1e-4
    """Weight of the margin against the hinge loss."""
    hidden_units: tuple[int, ...] = (128,)
    """Of the network: width of each dense layer."""
    layer_norm: bool = False
    """Of the network: normalise each dense layer before its activation."""
    learning_rate: float = 1e-3
    """Of the network: step size of Adam."""
    batch_size: int = 64
    """Of the network: transitions in a mini-batch."""
    epochs: int = 1
    """Passes over an episode after its end."""

    leaf_decisions: int = 2
    """Of the tree: fewest decisions in a leaf."""
    capacity: int = 100_000
    """Of the tree: decisions remembered."""

    def __post_init__(self) -> None:
        if self.leaf_decisions < 1 or self.capacity < 1:
            raise UsageError("reward.leaf_decisions and capacity must be 1 or more")
        if min(*self.hidden_units, self.batch_size, self.epochs) < 1:
            raise UsageError("reward.hidden_units, batch_size and epochs must all be 1 or more")
        if not (self.svm_lambda > 0 and self.learning_rate > 0):
            raise UsageError("reward.svm_lambda and learning_rate must be above 0")


def _signs(scores: NDArray[Any]) -> Ints:
    """Return the sign with the highest score in each row of ``(b, 3)``."""
    signs: Ints = SIGNS[np.argmax(scores, axis=1)]
    return signs


def make_reward_model(
    config: RewardConfig, dimension: int, n_actions: int, *, seed: int = 0
) -> "RewardSVM | RewardNetwork | RewardTree":
    """Make the model that the configuration asks for."""
    if config.kind == "svm":
        return RewardSVM(config, dimension, n_actions, seed=seed)
    if config.kind == "network":
        return RewardNetwork(config, dimension, n_actions, seed=seed)
    return RewardTree(config, dimension, n_actions)


class RewardSVM:
    """Three linear support vector machines, one against all, learned by stochastic gradient descent.

    The step size is 1 / (λ (t + t₀)), with t₀ by Bottou's heuristic, as scikit-learn has it.

    Parameters
    ----------
    config
        See `RewardConfig`.
    dimension
        Length of a state.
    n_actions
        Number of actions.
    seed
        Of the order of transitions.
    """

    def __init__(self, config: RewardConfig, dimension: int, n_actions: int, *, seed: int = 0) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        self.seed = seed
        self._svm = self._new()

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        rows = features(transitions.states, transitions.previous, transitions.actions, self.n_actions)
        if len(rows):
            self._svm.partial_fit(rows.astype(np.float64), np.sign(transitions.rewards).astype(int), classes=SIGNS)
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Ints:
        """Return −1, 0 or 1 for each row, ``(b,)`` int64; 0 before anything was learned."""
        if not hasattr(self._svm, "coef_"):
            return np.zeros(len(states), np.int64)
        rows = features(states, previous, actions, self.n_actions)
        return _signs(rows @ self._svm.coef_.T + self._svm.intercept_)

    def to_arrays(self) -> Arrays:
        """Return the three planes and the step that the schedule has reached."""
        if not hasattr(self._svm, "coef_"):
            return {}
        return {"planes": self._svm.coef_, "offsets": self._svm.intercept_, "steps": np.array(self._svm.t_)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self._svm = self._new()
        if "planes" in arrays:
            self._svm.classes_ = SIGNS
            self._svm.n_features_in_ = arrays["planes"].shape[1]
            self._svm.coef_, self._svm.intercept_ = arrays["planes"].copy(), arrays["offsets"].copy()
            self._svm.t_ = float(arrays["steps"])

    def _new(self) -> SGDClassifier:
        return SGDClassifier(
            loss="hinge", alpha=self.config.svm_lambda, learning_rate="optimal", random_state=self.seed
        )


class RewardNetwork:
    """A dense layer and a softmax over loss, nothing and gain.

    Parameters
    ----------
    config
        See `RewardConfig`.
    dimension
        Length of a state.
    n_actions
        Number of actions.
    seed
        Of weights and the order of transitions.
    """

    def __init__(self, config: RewardConfig, dimension: int, n_actions: int, *, seed: int = 0) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        n_inputs = 2 * dimension + n_actions
        self.network = DenseNetwork(
            n_inputs,
            config.hidden_units,
            len(SIGNS),
            layer_norm=config.layer_norm,
            learning_rate=config.learning_rate,
            betas=(0.9, 0.999),
            batch_size=config.batch_size,
            seed=seed,
        )
        self._centre = np.zeros(n_inputs, np.float32)
        self._scale = np.ones(n_inputs, np.float32)
        self.is_fitted = False

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions; the inputs are scaled as in the first ones."""
        rows = features(transitions.states, transitions.previous, transitions.actions, self.n_actions)
        if not self.is_fitted:
            self._centre, self._scale = rows.mean(axis=0), spread(rows)
        wanted = np.sign(transitions.rewards).astype(np.int64) + 1
        self.network.learn((rows - self._centre) / self._scale, wanted, functional.cross_entropy)
        self.is_fitted = True
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Ints:
        """Return −1, 0 or 1 for each row, ``(b,)`` int64; 0 before anything was learned."""
        if not self.is_fitted:
            return np.zeros(len(states), np.int64)
        rows = features(states, previous, actions, self.n_actions)
        return _signs(self.network((rows - self._centre) / self._scale))

    def to_arrays(self) -> Arrays:
        """Return the network and its scales."""
        own = {"centre": self._centre, "scale": self._scale, "is_fitted": np.array(self.is_fitted)}
        return nest(network=self.network.to_arrays()) | own

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.network.from_arrays(unnest(arrays, "network"))
        self._centre, self._scale = arrays["centre"], arrays["scale"]
        self.is_fitted = bool(arrays["is_fitted"])


class RewardTree:
    """A regression tree for the sign of the reward, rounded.

    Parameters
    ----------
    config
        See `RewardConfig`.
    dimension
        Length of a state, at most 32.
    n_actions
        Number of actions.
    """

    def __init__(self, config: RewardConfig, dimension: int, n_actions: int) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        self.forest = Forest(config.leaf_decisions)
        self.memory = Memory(config.capacity, dimension)

    def partial_fit(self, transitions: Transitions) -> Self:
        """Remember some transitions and, when there are enough new ones, grow the tree from all."""
        if self.memory.add(transitions):
            known = self.memory.transitions
            rows = relational_features(known.states, known.previous, known.actions, self.n_actions)
            self.forest.fit(rows, np.sign(known.rewards)[:, None])
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Ints:
        """Return −1, 0 or 1 for each row, ``(b,)`` int64; 0 before anything was learned."""
        if not self.memory.fitted_:
            return np.zeros(len(states), np.int64)
        rows = relational_features(states, previous, actions, self.n_actions)
        return np.rint(self.forest(rows)[:, 0]).astype(np.int64)

    def to_arrays(self) -> Arrays:
        """Return tree and memory."""
        return nest(forest=self.forest.to_arrays(), memory=self.memory.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.forest.from_arrays(unnest(arrays, "forest"))
        self.memory.from_arrays(unnest(arrays, "memory"))
