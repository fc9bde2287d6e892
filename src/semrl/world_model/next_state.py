"""Predicting what state comes next (§3.4.3, Fig. 3.9)."""

from typing import Self

import numpy as np
from torch.nn import functional

from semrl.core import Floats, Ints, Transitions
from semrl.world_model.config import NextStateConfig
from semrl.world_model.network import DenseNetwork, NetworkModel, spread


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

    SAVED = (*NetworkModel.SAVED, "_change_scale", "_low", "_high")

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
        self._low = np.full(dimension, np.inf, np.float32)
        self._high = np.full(dimension, -np.inf, np.float32)

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        targets = transitions.next_states
        self._low = np.minimum(self._low, targets.min(axis=0, initial=np.inf))
        self._high = np.maximum(self._high, targets.max(axis=0, initial=-np.inf))
        if self.config.predict_change:
            changes = targets - transitions.states
            if not self.is_fitted:
                self._fit_scale(transitions)
                self._change_scale = spread(changes)
            targets = changes / self._change_scale
        loss = functional.smooth_l1_loss if self.config.predict_change else functional.mse_loss
        self.network.learn(self._rows(transitions.states, transitions.previous, transitions.actions), targets, loss)
        self.is_fitted = True
        return self

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return the next states, ``(b, d)`` float32."""
        predicted = self.network(self._rows(states, previous, actions))
        if self.config.predict_change:
            predicted = states + predicted * self._change_scale
        if self.config.within_seen and self.is_fitted:
            np.clip(predicted, self._low, self._high, out=predicted)
        return predicted
