"""Deep Q-learning (§3.3; Mnih et al. 2015), with the additions that proved worth it here."""

from functools import cached_property, partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semrl.agents.config import DQNConfig
from semrl.agents.devices import Device, pick_device
from semrl.agents.networks import QNetwork
from semrl.agents.replay import Batch, ReplayBuffer
from semrl.agents.vector_network import VectorUpdates
from semrl.core import AgentObservation, Floats, Ints, StateSpace
from semrl.core.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.core.beside import Started
from semrl.core.errors import SemrlError
from semrl.core.networks import arrays_to_module, arrays_to_optimiser, module_to_arrays, optimiser_to_arrays


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
        self._compiled = self._new_compiled()
        self._updating: Started[None] | None = None  # an update that goes on beside play
        self._rng = np.random.default_rng(seed)
        self._head = 0  # which is followed
        self.decisions_ = 0
        self._updates = 0
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
        return self._updates

    @property
    def loss_(self) -> float:
        """Loss of the newest of them, NaN before."""
        self._await_update()
        return self._loss

    @cached_property
    def optimiser(self) -> torch.optim.Adam:
        """What updates in PyTorch are made with."""
        c = self.config
        return torch.optim.Adam(
            self._network.parameters(),
            lr=c.learning_rate,
            betas=(c.adam_beta1, c.adam_beta2),
            eps=c.adam_epsilon,
            fused=not self._network.state_input.is_image,  # twice as fast for small networks, slower for convolutions
        )

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
            states, plans = (self._tensor(x) for x in self.replay.latest(c.learning_starts))
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
        if self._compiled:
            self._loss, gradients = self._compiled.loss_and_gradients(batch, self.n_actions)
            self._check_loss()
            self._compiled.step(gradients, rate)
        else:
            self._update_in_torch(batch, rate)
        self._updates += 1
        if self._updates % self.config.target_update_interval == 0:
            self._renew_target()

    def _learn(self) -> None:
        """Update on a batch drawn now: in compiled code beside play, until somebody asks for what came of it."""
        batch, rate = self._sample(), self.learning_rate
        self._await_update()
        update = partial(self.update, batch, rate)
        if self._compiled:
            self._updating = Started(update)
        else:
            update()

    def _await_update(self) -> None:
        """Wait until no update goes on; before that, weights, loss and number of updates are not to be read."""
        updating, self._updating = self._updating, None
        if updating:
            updating.result()

    def _update_in_torch(self, batch: Batch, learning_rate: float) -> None:
        values = self._per_head(self._network(self._tensor(batch.states), self._tensor(batch.plans)))
        taken = self._of_actions(values, batch.actions)
        loss = functional.smooth_l1_loss(taken, self._targets(batch))
        if self.config.advice_weight:
            loss = loss + self.config.advice_weight * self._advice_missed(values, batch.advised)
        self._loss = float(loss.detach())
        self._check_loss()
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()

    def _check_loss(self) -> None:
        if not np.isfinite(self._loss):
            raise SemrlError(
                f"the loss is {self._loss} after {self._updates} updates: learning has diverged; "
                "try a smaller --dqn.learning-rate"
            )

    def _new_compiled(self) -> VectorUpdates | None:
        """Return the same networks in compiled code, where that is faster: for vectors on the CPU."""
        if self._network.state_input.is_image or self.device.type != "cpu":
            return None
        return VectorUpdates(self.config, self._network, self.target)

    def to_arrays(self) -> Arrays:
        """Return weights, optimiser, replay, counters and the random generator."""
        return {
            **nest(
                network=module_to_arrays(self.network),
                target=module_to_arrays(self.target),
                optimiser=self._compiled.moments_to_arrays() if self._compiled else optimiser_to_arrays(self.optimiser),
                replay=self.replay.to_arrays(),
            ),
            "rng": rng_to_array(self._rng),
            "counters": np.array([self.decisions_, self._updates]),
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
        moments = unnest(arrays, "optimiser")
        if self._compiled:
            self._compiled.moments_from_arrays(moments)
        else:
            arrays_to_optimiser(self.optimiser, moments)
        self.replay.from_arrays(unnest(arrays, "replay"))
        self._rng = array_to_rng(arrays["rng"])
        self.decisions_, self._updates = (int(n) for n in arrays["counters"])
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
        margins = torch.full((len(given), 1, self.n_actions), self.config.advice_margin, device=self.device)
        margins[torch.arange(len(given), device=self.device), 0, self._tensor(advice)] = 0.0
        return ((values + margins).amax(dim=2) - self._of_actions(values, advice)).mean()

    def _per_head(self, values: Tensor) -> Tensor:
        """View the network's output as ``(b, heads, n_actions)``."""
        return values.view(len(values), self.config.heads, self.n_actions)

    def _head_values(self, shown: AgentObservation) -> Floats:
        """Return what each head makes of one state, ``(heads, n_actions)``."""
        self._await_update()
        if self._compiled:
            online = self._compiled.online
            rows = online.inputs(shown.vectors[None], shown.plan[None])
            return online.values(rows).reshape(self.config.heads, self.n_actions)
        with torch.inference_mode():
            values = self._network(self._tensor(shown.vectors[None]), self._tensor(shown.plan[None]))
            return np.asarray(self._per_head(values)[0].cpu().numpy(), dtype=np.float32)

    def _tensor(self, array: NDArray[Any]) -> Tensor:
        return torch.from_numpy(array).to(self.device)

    def _renew_target(self) -> None:
        if self._compiled:
            self._compiled.renew_target()
            return
        with torch.no_grad():
            for old, new in zip(self.target.parameters(), self._network.parameters(), strict=True):
                old.lerp_(new, self.config.tau)
