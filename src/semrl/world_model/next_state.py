"""Predicting what state comes next (§3.4.3, Fig. 3.9)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from torch.nn import functional

from semrl.core import Floats, Ints, Transitions
from semrl.core.arrays import Arrays
from semrl.core.errors import UsageError
from semrl.world_model.network import DenseNetwork, NetworkModel, spread


@dataclass(frozen=True, kw_only=True, slots=True)
class NextStateConfig:
    """Settings of the next-state model; the defaults are the thesis's (§3.4.3)."""

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

    def __post_init__(self) -> None:
        if min(*self.hidden_units, self.batch_size, self.epochs) < 1:
            raise UsageError("next_state.hidden_units, batch_size and epochs must all be 1 or more")
        if not (self.learning_rate > 0 and 0 <= self.adam_beta1 < 1 and 0 <= self.adam_beta2 < 1):
            raise UsageError("next_state.learning_rate must be above 0, and adam_beta1 and adam_beta2 lie in 0 … 1")


class NextStateNetwork(NetworkModel):
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
        network = DenseNetwork(
            2 * dimension + n_actions,
            config.hidden_units,
            dimension,
            layer_norm=config.layer_norm,
            learning_rate=config.learning_rate,
            betas=(config.adam_beta1, config.adam_beta2),
            batch_size=config.batch_size,
            seed=seed,
        )
        super().__init__(network, dimension, n_actions)
        self.config = config
        self._change_scale = np.ones(dimension, np.float32)

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        wanted = transitions.next_states
        if self.config.predict_change:
            changes = wanted - transitions.states
            if not self.is_fitted:
                self._fit_scale(transitions)
                self._change_scale = spread(changes)
            wanted = changes / self._change_scale
        loss = functional.smooth_l1_loss if self.config.predict_change else functional.mse_loss
        self.network.learn(self._rows(transitions.states, transitions.previous, transitions.actions), wanted, loss)
        self.is_fitted = True
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return the next states, ``(b, d)`` float32."""
        predicted = self.network(self._rows(states, previous, actions))
        return states + predicted * self._change_scale if self.config.predict_change else predicted

    def to_arrays(self) -> Arrays:
        """Return the network and its scales."""
        return super().to_arrays() | {"change_scale": self._change_scale}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        super().from_arrays(arrays)
        self._change_scale = arrays["change_scale"]
