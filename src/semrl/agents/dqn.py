"""Deep Q-learning (§3.3; Mnih et al. 2015), with the additions that proved worth it here."""

from functools import partial
from typing import Any

import numpy as np
import torch

from semrl.agents.config import DQNConfig
from semrl.agents.devices import Device, pick_device
from semrl.agents.networks import QNetwork
from semrl.agents.replay import Batch, ReplayBuffer
from semrl.agents.torch_updates import TorchUpdates
from semrl.agents.updates import Updates
from semrl.agents.vector_updates import VectorUpdates
from semrl.core import AgentObservation, Floats, StateSpace
from semrl.core.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.core.beside import Started
from semrl.core.errors import SemrlError
from semrl.core.networks import arrays_to_module, module_to_arrays


class DQN:
    """An agent that learns action values by deep Q-learning.

    Parameters
    ----------
    config
        Parameters of learning.
    space
        Of what it is shown: images, ``(84, 84)`` uint8, or vectors, ``(d,)`` float32.
    n_actions
        Number of actions.
    seed
        Of weights, exploration and replay.
    plan_size
        Features of a plan that it is shown as well (§3.4.4).
    budget
        Decisions in all, by which learning rate and exploration fall late; when None, they do not.
    device
        Where the networks are: ``"auto"`` takes a GPU where there is one, else the CPU.
    """

    def __init__(
        self,
        config: DQNConfig,
        *,
        space: StateSpace,
        n_actions: int,
        seed: int,
        plan_size: int = 0,
        budget: int | None = None,
        device: Device = "cpu",
    ) -> None:
        self.config = config
        self.n_actions = n_actions
        self.budget = budget
        self.device = pick_device(device)
        self.replay = ReplayBuffer(config.replay_capacity, space.shape, space.dtype, plan_size)
        n_values = n_actions * config.heads
        self._network, self.target = (
            QNetwork(space.shape, n_values, config.network, seed=seed, plan_size=plan_size).to(self.device)
            for _ in range(2)
        )
        in_torch = self._network.state_input.is_image or self.device.type != "cpu"
        made_by = TorchUpdates if in_torch else VectorUpdates  # which is faster, for vectors on the CPU
        self._updates: Updates = made_by(config, self._network, self.target, n_actions)
        self._updating: Started[None] | None = None  # an update that goes on beside play
        self._rng = np.random.default_rng(seed)
        self._head = 0  # which is followed
        self.decisions_ = 0
        self._count = 0  # of updates
        self._loss = float("nan")

    @property
    def network(self) -> QNetwork:
        """The online network, with all that was learned so far."""
        self._await_update()
        return self._network

    @property
    def updates_(self) -> int:
        """Updates so far."""
        self._await_update()
        return self._count

    @property
    def loss_(self) -> float:
        """Loss of the newest of them, NaN before."""
        self._await_update()
        return self._loss

    @property
    def exploration(self) -> float:
        """Probability that the next action is random: exponential decay from maximum to minimum."""
        c = self.config
        progress = min(1.0, self.decisions_ / c.exploration_decisions)
        usual = float(c.exploration_max * (c.exploration_min / c.exploration_max) ** progress)
        return usual * self._late(c.final_exploration)

    @property
    def learning_rate(self) -> float:
        """Step size of the next update."""
        return self.config.learning_rate * self._late(self.config.final_learning_rate)

    def _late(self, final: float) -> float:
        """Return what is left now of something of which a share is left at the end of the budget."""
        late = 0.0 if self.budget is None else max(0.0, 2 * min(1.0, self.decisions_ / self.budget) - 1)
        return 1 - late * (1 - final)

    def act(self, shown: AgentObservation, advised: int | None = None) -> int:
        """Choose an action: ε-greedy. Advice, where there is any, is followed in place of the values."""
        if self._rng.random() < self.exploration:
            return int(self._rng.integers(self.n_actions))
        if advised is not None:
            return advised
        values = self._head_values(shown)
        share = self.config.ensemble_share * (1 - self._late(0.0))
        followed = values.mean(axis=0) if share and self._rng.random() < share else values[self._head]
        return int(followed.argmax())

    def best_action(self, shown: AgentObservation) -> int:
        """Return the action of the highest value."""
        return int(self.action_values(shown).argmax())

    def action_values(self, shown: AgentObservation) -> Floats:
        """Return the estimated values of all actions, ``(n_actions,)``: the heads' mean."""
        return np.asarray(self._head_values(shown).mean(axis=0))

    def observe(
        self,
        shown: AgentObservation,
        action: int,
        reward: float,
        *,
        terminated: bool,
        start: bool,
        advised: int | None = None,
    ) -> None:
        """Remember one decision, and what a planner would have done, and, when it is time, learn."""
        c = self.config
        reward = float(np.sign(reward)) if c.clip_rewards else reward
        self.replay.add(
            shown.vectors[0], shown.plan, action, reward, terminated=terminated, start=start, advised=advised
        )
        self.decisions_ += 1
        if reward or self._rng.random() * c.head_decisions < 1:
            self._head = int(self._rng.integers(c.heads))
        if self.decisions_ == c.learning_starts and c.network.normalise_input:
            states, plans = (torch.from_numpy(x).to(self.device) for x in self.replay.latest(c.learning_starts))
            for network in (self._network, self.target):
                network.state_input.fit(states, plans)
        if self.decisions_ >= c.learning_starts and self.decisions_ % c.train_freq == 0:
            self._learn()

    def end_episode(self, shown: AgentObservation) -> None:
        """Remember the last state of an episode."""
        self.replay.end_episode(shown.vectors[0], shown.plan)

    def measured(self) -> dict[str, Any]:
        """Return exploration, the newest loss and the number of updates."""
        return {"exploration": self.exploration, "loss": self.loss_, "updates": self.updates_}

    def update(self, batch: Batch, learning_rate: float | None = None) -> None:
        """Take one gradient step on a batch (eq. 2.1 with the squared error clipped to linear beyond 1).

        Parameters
        ----------
        batch
            Of transitions.
        learning_rate
            Step size; that of this decision when None.

        Raises
        ------
        SemrlError
            When the loss is not a number.
        """
        rate = self.learning_rate if learning_rate is None else learning_rate
        self._loss = self._updates.update(batch, rate)
        if not np.isfinite(self._loss):
            raise SemrlError(
                f"the loss is {self._loss} after {self._count} updates: learning has diverged; "
                "try a smaller --dqn.learning-rate"
            )
        self._count += 1
        if self._count % self.config.target_update_interval == 0:
            self._updates.renew_target()

    def _learn(self) -> None:
        """Update on a batch drawn now: beside play where that may be, until somebody asks for what came of it."""
        batch, rate = self._sample(), self.learning_rate
        self._await_update()
        update = partial(self.update, batch, rate)
        if self._updates.beside_play:
            self._updating = Started(update)
        else:
            update()

    def _await_update(self) -> None:
        """Wait until no update goes on; before that, weights, loss and number of updates are not to be read."""
        updating, self._updating = self._updating, None
        if updating:
            updating.result()

    def to_arrays(self) -> Arrays:
        """Return weights, optimiser, replay, counters and the random generator."""
        return {
            **nest(
                network=module_to_arrays(self.network),
                target=module_to_arrays(self.target),
                optimiser=self._updates.to_arrays(),
                replay=self.replay.to_arrays(),
            ),
            "rng": rng_to_array(self._rng),
            "counters": np.array([self.decisions_, self._count]),
            "head": np.array(self._head),
            "loss": np.array(self._loss),
        }

    def inference_arrays(self) -> Arrays:
        """Return the weights of the Q-network alone."""
        return nest(network=module_to_arrays(self.network))

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called; of the weights alone, play as it did there."""
        arrays_to_module(self.network, unnest(arrays, "network"))
        if "counters" not in arrays:
            return
        arrays_to_module(self.target, unnest(arrays, "target"))
        self._updates.from_arrays(unnest(arrays, "optimiser"))
        self.replay.from_arrays(unnest(arrays, "replay"))
        self._rng = array_to_rng(arrays["rng"])
        self.decisions_, self._count = (int(n) for n in arrays["counters"])
        self._head = int(arrays["head"])
        self._loss = float(arrays["loss"])

    def _sample(self) -> Batch:
        c = self.config
        return self.replay.sample(
            self._rng,
            c.batch_size,
            n_steps=c.n_steps,
            discount=c.discount,
            reward_share=c.reward_share,
        )

    def _head_values(self, shown: AgentObservation) -> Floats:
        """Return what each head makes of one state, ``(heads, n_actions)``."""
        self._await_update()
        return self._updates.values(shown.vectors[None], shown.plan[None]).reshape(self.config.heads, self.n_actions)
