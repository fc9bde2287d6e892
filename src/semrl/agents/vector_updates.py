"""Updates of Q-networks of vectors in compiled code: loss, gradient, Adam, target network.

PyTorch's own Adam is not asked for: to make one takes it seconds.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.agents.config import DQNConfig
from semrl.agents.networks import QNetwork
from semrl.agents.replay import Batch
from semrl.agents.vector_kernels import adam, loss_and_gradient, move_towards
from semrl.agents.vector_network import Rows, VectorNetwork, view_of
from semrl.core import Floats
from semrl.core.arrays import Arrays, nest, unnest


class VectorUpdates:
    """Updates of Q-networks of vectors on the CPU; see `Updates`.

    Parameters
    ----------
    config
        See `DQNConfig`.
    network, target
        The online network and the target network; both learn in place.
    n_actions
        Number of actions.
    """

    beside_play = True

    def __init__(self, config: DQNConfig, network: QNetwork, target: QNetwork, n_actions: int) -> None:
        self.config = config
        self.n_actions = n_actions
        self.online, self.target = VectorNetwork(network), VectorNetwork(target)
        weights, targets = ([view_of(p) for p in side.parameters()] for side in (network, target))
        self._weights, self._targets = ([part.reshape(-1) for part in side] for side in (weights, targets))
        self._moments = [(np.zeros_like(part), np.zeros_like(part)) for part in weights]
        self._steps = 0

    def values(self, states: NDArray[Any], plans: Floats) -> Floats:
        """Return what the online network makes of states and plans, ``(b, n_values)``."""
        return self.online.values(self.online.inputs(states, plans))

    def update(self, batch: Batch, learning_rate: float) -> float:
        """Take one step of Adam on a batch, unless its loss is no number; return the loss."""
        loss, gradients = self.loss_and_gradients(batch)
        if math.isfinite(loss):
            self._step(gradients, learning_rate)
        return loss

    def loss_and_gradients(self, batch: Batch) -> tuple[float, list[Floats]]:
        """Return the loss of a batch and its gradients, in the order of the parameters."""
        c, n = self.config, len(batch.states)
        states = np.concatenate([batch.states, batch.next_states])
        rows = Rows.of(self.online.inputs(states, np.concatenate([batch.plans, batch.next_plans])))
        both, passes = self.online.forward(rows if c.double else rows[:n])
        following = self.target.forward(rows[n:])[0]
        shape = (n, c.heads, self.n_actions)
        back = np.empty(shape, np.float32)
        loss = loss_and_gradient(
            both[:n].reshape(shape), (both[n:] if c.double else following).reshape(shape), following.reshape(shape),
            batch.returns, batch.discounts, batch.actions, batch.advised, c.advice_margin, c.advice_weight, back,
        )  # fmt: skip
        return loss, self.online.backward(rows[:n], passes, back.reshape(n, -1))

    def _step(self, gradients: list[Floats], learning_rate: float) -> None:
        c = self.config
        self._steps += 1
        done = self._steps
        rates = np.array(
            [
                1 - c.adam_beta1, c.adam_beta2, 1 - c.adam_beta2, learning_rate / (1 - c.adam_beta1**done),
                math.sqrt(1 - c.adam_beta2**done), c.adam_epsilon,
            ],
            np.float32,
        )  # fmt: skip
        for weights, gradient, (mean, square) in zip(self._weights, gradients, self._moments, strict=True):
            adam(weights, gradient.ravel(), mean.reshape(-1), square.reshape(-1), rates)

    def to_arrays(self) -> Arrays:
        """Return the moments of each parameter, as the arrays of PyTorch's Adam are named; none before a step."""
        if not self._steps:
            return {}
        parts = {
            str(i): {"step": np.array(self._steps, np.float32), "exp_avg": mean, "exp_avg_sq": square}
            for i, (mean, square) in enumerate(self._moments)
        }
        return nest(**parts)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        for i, moments in enumerate(self._moments):
            saved = unnest(arrays, str(i))
            for name, moment in zip(("exp_avg", "exp_avg_sq"), moments, strict=True):
                moment[...] = saved[name] if saved else 0
        self._steps = int(arrays["0/step"]) if arrays else 0

    def renew_target(self) -> None:
        """Move the target network towards the online network."""
        for old, new in zip(self._targets, self._weights, strict=True):
            move_towards(old, new, self.config.tau)
