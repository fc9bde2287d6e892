"""Updates of Q-networks in PyTorch: for images, and on a GPU."""

from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semrl.agents.config import DQNConfig
from semrl.agents.networks import QNetwork
from semrl.agents.replay import Batch
from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.networks import arrays_to_optimiser, optimiser_to_arrays


class TorchUpdates:
    """Updates of any Q-network, on its own device; see `Updates`.

    Parameters
    ----------
    config
        See `DQNConfig`.
    network, target
        The online network and the target network; both learn in place.
    n_actions
        Number of actions.
    """

    beside_play = False

    def __init__(self, config: DQNConfig, network: QNetwork, target: QNetwork, n_actions: int) -> None:
        self.config = config
        self.n_actions = n_actions
        self.target = target
        self._network = network
        self._device = next(network.parameters()).device

    @cached_property
    def optimiser(self) -> torch.optim.Adam:
        """Adam, made when it is first asked for: that takes seconds."""
        c = self.config
        return torch.optim.Adam(
            self._network.parameters(),
            lr=c.learning_rate,
            betas=(c.adam_beta1, c.adam_beta2),
            eps=c.adam_epsilon,
            fused=not self._network.state_input.is_image,  # twice as fast for small networks, slower for convolutions
        )

    def values(self, states: NDArray[Any], plans: Floats) -> Floats:
        """Return what the online network makes of states and plans, ``(b, n_values)``."""
        with torch.inference_mode():
            values = self._network(self._tensor(states), self._tensor(plans))
        return np.asarray(values.cpu().numpy(), dtype=np.float32)

    def update(self, batch: Batch, learning_rate: float) -> float:
        """Take one step of Adam on a batch, unless its loss is no number; return the loss."""
        values = self._per_head(self._network(self._tensor(batch.states), self._tensor(batch.plans)))
        taken = self._of_actions(values, batch.actions)
        loss = functional.smooth_l1_loss(taken, self._targets(batch))
        if self.config.advice_weight:
            loss = loss + self.config.advice_weight * self._advice_missed(values, batch.advised)
        if not torch.isfinite(loss):
            return float(loss.detach())
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        return float(loss.detach())

    def renew_target(self) -> None:
        """Move the target network towards the online network."""
        with torch.no_grad():
            for old, new in zip(self.target.parameters(), self._network.parameters(), strict=True):
                old.lerp_(new, self.config.tau)

    def to_arrays(self) -> Arrays:
        """Return the moments of Adam."""
        return optimiser_to_arrays(self.optimiser)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        arrays_to_optimiser(self.optimiser, arrays)

    def _targets(self, batch: Batch) -> Tensor:
        with torch.no_grad():
            following = self._tensor(batch.next_states), self._tensor(batch.next_plans)
            next_values = self._per_head(self.target(*following))
            if self.config.double:
                best = self._per_head(self._network(*following)).argmax(dim=2, keepdim=True)
                value = next_values.gather(2, best)[:, :, 0]
            else:
                value = next_values.amax(dim=2)
            returns, discounts = self._tensor(batch.returns), self._tensor(batch.discounts)
            targets: Tensor = returns[:, None] + discounts[:, None] * value  # (b, heads)
        return targets

    def _of_actions(self, values: Tensor, actions: Ints) -> Tensor:
        """Return the values of ``(b,)`` actions, ``(b, heads)``, of ``(b, heads, n_actions)``."""
        return values.gather(2, self._tensor(actions)[:, None, None].expand(-1, self.config.heads, 1))[:, :, 0]

    def _advice_missed(self, values: Tensor, advised: Ints) -> Tensor:
        """Return by how much advised actions fall short of the margin over all others, on average."""
        given = np.flatnonzero(advised >= 0)
        if not len(given):
            return values.new_zeros(())
        values, advice = values[self._tensor(given)], advised[given]
        margins = torch.full((len(given), 1, self.n_actions), self.config.advice_margin, device=self._device)
        margins[torch.arange(len(given), device=self._device), 0, self._tensor(advice)] = 0.0
        return ((values + margins).amax(dim=2) - self._of_actions(values, advice)).mean()

    def _per_head(self, values: Tensor) -> Tensor:
        """View the network's output as ``(b, heads, n_actions)``."""
        return values.view(len(values), self.config.heads, self.n_actions)

    def _tensor(self, array: NDArray[Any]) -> Tensor:
        return torch.from_numpy(array).to(self._device)
