"""Predicting what state comes next (§3.4.3, Fig. 3.9)."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from torch.nn import functional

from semrl.arrays import Arrays, nest, unnest
from semrl.errors import UsageError
from semrl.ontology.network import DenseNetwork, features, spread
from semrl.ontology.trees import Forest, Memory, relational_features
from semrl.types import Floats, Ints, Transitions


@dataclass(frozen=True, kw_only=True, slots=True)
class NextStateConfig:
    """Settings of the next-state model; the defaults are the thesis's (§3.4.3)."""

    kind: Literal["network", "trees"] = "network"
    """A network, or regression trees for short states, which need no rehearsal; the last two settings are theirs."""
    hidden_units: tuple[int, ...] = (512,)
    """Width of each dense layer."""
    layer_norm: bool = False
    """Normalise each dense layer before its activation (Ba et al. 2016)."""
    learning_rate: float = 1e-4
    """Step size of Adam."""
    adam_beta1: float = 0.99
    """Adam's memory of gradients."""
    adam_beta2: float = 0.999
    """Adam's memory of squared gradients."""
    batch_size: int = 64
    """Transitions in a mini-batch."""
    epochs: int = 100
    """Passes over an episode after its end."""
    predict_change: bool = False
    """Predict what changes in place of the whole state, inputs and changes scaled as in the first episode, with the
    squared error linear beyond 1."""

    leaf_decisions: int = 2
    """Of trees: fewest decisions in a leaf."""
    capacity: int = 100_000
    """Of trees: decisions remembered."""

    def __post_init__(self) -> None:
        if self.leaf_decisions < 1 or self.capacity < 1:
            raise UsageError("next_state.leaf_decisions and capacity must be 1 or more")
        if min(*self.hidden_units, self.batch_size, self.epochs) < 1:
            raise UsageError("next_state.hidden_units, batch_size and epochs must all be 1 or more")
        if not (self.learning_rate > 0 and 0 <= self.adam_beta1 < 1 and 0 <= self.adam_beta2 < 1):
            raise UsageError("next_state.learning_rate must be above 0, and adam_beta1 and adam_beta2 lie in 0 … 1")


def make_next_state_model(
    config: NextStateConfig, dimension: int, n_actions: int, *, seed: int = 0
) -> "NextStateNetwork | NextStateTrees":
    """Make the model that the configuration asks for."""
    if config.kind == "trees":
        return NextStateTrees(config, dimension, n_actions)
    return NextStateNetwork(config, dimension, n_actions, seed=seed)


class NextStateNetwork:
    """A dense layer that maps state, difference and action to the next state.

    Parameters
    ----------
    config
        See `NextStateConfig`.
    dimension
        Length of a state.
    n_actions
        Number of actions.
    seed
        Of weights and the order of transitions.
    """

    def __init__(self, config: NextStateConfig, dimension: int, n_actions: int, *, seed: int = 0) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        n_inputs = 2 * dimension + n_actions
        self.network = DenseNetwork(
            n_inputs,
            config.hidden_units,
            dimension,
            layer_norm=config.layer_norm,
            learning_rate=config.learning_rate,
            betas=(config.adam_beta1, config.adam_beta2),
            batch_size=config.batch_size,
            seed=seed,
        )
        self._centre = np.zeros(n_inputs, np.float32)
        self._scale = np.ones(n_inputs, np.float32)
        self._change_scale = np.ones(dimension, np.float32)
        self.is_fitted = False

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        inputs = features(transitions.states, transitions.previous, transitions.actions, self.n_actions)
        wanted = transitions.next_states
        if self.config.predict_change:
            changes = wanted - transitions.states
            if not self.is_fitted:
                self._centre, self._scale = inputs.mean(axis=0), spread(inputs)
                self._change_scale = spread(changes)
            wanted = changes / self._change_scale
        loss = functional.smooth_l1_loss if self.config.predict_change else functional.mse_loss
        self.network.learn((inputs - self._centre) / self._scale, wanted, loss)
        self.is_fitted = True
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return the next states, ``(b, d)`` float32."""
        inputs = features(states, previous, actions, self.n_actions)
        predicted = self.network((inputs - self._centre) / self._scale)
        return states + predicted * self._change_scale if self.config.predict_change else predicted

    def to_arrays(self) -> Arrays:
        """Return the network and its scales."""
        return {
            **nest(network=self.network.to_arrays()),
            "centre": self._centre,
            "scale": self._scale,
            "change_scale": self._change_scale,
            "is_fitted": np.array(self.is_fitted),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.network.from_arrays(unnest(arrays, "network"))
        self._centre, self._scale = arrays["centre"], arrays["scale"]
        self._change_scale = arrays["change_scale"]
        self.is_fitted = bool(arrays["is_fitted"])


class NextStateTrees:
    """A regression tree for the change of each number of the state.

    Parameters
    ----------
    config
        See `NextStateConfig`.
    dimension
        Length of a state, at most 32.
    n_actions
        Number of actions.
    """

    def __init__(self, config: NextStateConfig, dimension: int, n_actions: int) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        self.forest = Forest(config.leaf_decisions)
        self.memory = Memory(config.capacity, dimension)

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned yet."""
        return self.memory.fitted_ > 0

    def partial_fit(self, transitions: Transitions) -> Self:
        """Remember some transitions and, when there are enough new ones, grow the trees from all."""
        if self.memory.add(transitions):
            known = self.memory.transitions
            rows = relational_features(known.states, known.previous, known.actions, self.n_actions)
            self.forest.fit(rows, known.next_states - known.states)
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return the next states, ``(b, d)`` float32; the same ones before anything was learned."""
        if not self.is_fitted:
            return states.copy()
        rows = relational_features(states, previous, actions, self.n_actions)
        return states + self.forest(rows).astype(np.float32)

    def to_arrays(self) -> Arrays:
        """Return trees and memory."""
        return nest(forest=self.forest.to_arrays(), memory=self.memory.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.forest.from_arrays(unnest(arrays, "forest"))
        self.memory.from_arrays(unnest(arrays, "memory"))
