"""Predicting the sign of a reward (§3.4.3): the thesis's support vector machines, or a small network."""

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray
from torch.nn import functional

from semrl.core import Floats, Ints, Transitions
from semrl.core.arrays import Arrays
from semrl.world_model.config import RewardConfig
from semrl.world_model.network import DenseNetwork, NetworkModel, features

if TYPE_CHECKING:
    from sklearn.linear_model import SGDClassifier

SIGNS: Ints = np.array([-1, 0, 1])


def _signs(scores: NDArray[Any]) -> Ints:
    """Return the sign with the highest score in each row of ``(b, 3)``."""
    signs: Ints = SIGNS[np.argmax(scores, axis=1)]
    return signs


def make_reward_model(
    config: RewardConfig, dimension: int, n_actions: int, *, seed: int = 0
) -> "RewardSVM | RewardNetwork":
    """Make the model that the configuration asks for."""
    if config.kind == "svm":
        return RewardSVM(config, dimension, n_actions, seed=seed)
    return RewardNetwork(config, dimension, n_actions, seed=seed)


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

    def _new(self) -> "SGDClassifier":
        from sklearn.linear_model import SGDClassifier

        return SGDClassifier(
            loss="hinge", alpha=self.config.svm_lambda, learning_rate="optimal", random_state=self.seed
        )


class RewardNetwork(NetworkModel):
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
        network = DenseNetwork(
            2 * dimension + n_actions,
            config.hidden_units,
            len(SIGNS),
            layer_norm=config.layer_norm,
            learning_rate=config.learning_rate,
            betas=(0.9, 0.999),
            batch_size=config.batch_size,
            seed=seed,
        )
        super().__init__(network, dimension, n_actions)
        self.config = config

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions; the inputs are scaled as in the first ones."""
        if not self.is_fitted:
            self._fit_scale(transitions)
        rows = self._rows(transitions.states, transitions.previous, transitions.actions)
        targets = np.sign(transitions.rewards).astype(np.int64) + 1
        self.network.learn(rows, targets, functional.cross_entropy)
        self.is_fitted = True
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Ints:
        """Return −1, 0 or 1 for each row, ``(b,)`` int64; 0 before anything was learned."""
        if not self.is_fitted:
            return np.zeros(len(states), np.int64)
        return _signs(self.network(self._rows(states, previous, actions)))
