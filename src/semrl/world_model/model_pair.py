"""The thesis's model of the world: one model says what state comes next, another what reward (§3.4.3)."""

import time
from collections.abc import Iterator

import numpy as np

from semrl.core import Floats, History, Ints, Scenarios, Trajectory, Transitions
from semrl.core.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.world_model.config import ModelPairConfig
from semrl.world_model.experience import Experience
from semrl.world_model.next_state import NextStateNetwork
from semrl.world_model.protocol import DynamicsModel, RewardModel
from semrl.world_model.reward import make_reward_model


class ModelPair:
    """Next state and reward, learned from each episode after its end.

    Parameters
    ----------
    config
        See `ModelPairConfig`.
    dimension
        Length of a state.
    n_actions
        Number of actions.
    seed
        Of networks and rehearsal.
    discount, axes
        Not needed: rewards are predicted as they come, and numbers are not compared.
    """

    def __init__(
        self,
        config: ModelPairConfig,
        dimension: int,
        n_actions: int,
        *,
        seed: int = 0,
        discount: float = 1.0,
        axes: Ints | None = None,
    ) -> None:
        del discount, axes
        self.config = config
        self.next_state = NextStateNetwork(config.next_state, dimension, n_actions, seed=seed)
        self.reward = make_reward_model(config.reward, dimension, n_actions, seed=seed)
        self.experience = Experience(config.rehearsal_states, dimension)
        self._rng = np.random.default_rng(seed)

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned yet."""
        return self.next_state.is_fitted

    def partial_fit(self, trajectory: Trajectory) -> dict[str, float]:
        """Learn from an episode; return the seconds that each model took."""
        began = time.perf_counter()
        if self.config.rehearsal_states:
            self.experience.add(trajectory)
        for lesson in self._lessons(self.config.next_state.epochs, trajectory):
            self.next_state.partial_fit(lesson)
        between = time.perf_counter()
        for lesson in self._lessons(self.config.reward.epochs, trajectory, balanced=True):
            self.reward.partial_fit(lesson)
        ended = time.perf_counter()
        return {"seconds_next_state": round(between - began, 4), "seconds_reward": round(ended - between, 4)}

    def update_online(self, so_far: Trajectory) -> None:
        """Learn nothing: an episode is learned from when it is over."""

    def imagine(self, history: History, sequences: Ints) -> Scenarios:
        """Roll ``(s, t)`` sequences of actions forward from a history."""
        state, previous = history.window(2)
        return roll_forward(state, previous, sequences, self.next_state, self.reward)

    def to_arrays(self) -> Arrays:
        """Return models, memory and the random generator."""
        parts = nest(
            next_state=self.next_state.to_arrays(),
            reward=self.reward.to_arrays(),
            experience=self.experience.to_arrays(),
        )
        return parts | {"rng": rng_to_array(self._rng)}

    def inference_arrays(self) -> Arrays:
        """Return the models alone."""
        return nest(next_state=self.next_state.to_arrays(), reward=self.reward.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called; of the models alone, predict as they did there."""
        self.next_state.from_arrays(unnest(arrays, "next_state"))
        self.reward.from_arrays(unnest(arrays, "reward"))
        if "rng" not in arrays:
            return
        self.experience.from_arrays(unnest(arrays, "experience"))
        self._rng = array_to_rng(arrays["rng"])

    def _lessons(self, epochs: int, trajectory: Trajectory, *, balanced: bool = False) -> Iterator[Transitions]:
        """Yield what a model learns from, pass by pass: the episode, or as much of what is remembered."""
        for _ in range(epochs):
            if not self.config.rehearsal_states:
                yield trajectory.transitions
            elif balanced:
                yield self.experience.draw_balanced(self._rng, len(trajectory))
            else:
                yield self.experience.draw(self._rng, len(trajectory), self.config.rehearsal_reward_share)


def roll_forward(
    state: Floats, previous: Floats, sequences: Ints, dynamics: DynamicsModel, reward: RewardModel
) -> Scenarios:
    """Roll sequences of actions forward, all at once (§3.4.3).

    Parameters
    ----------
    state, previous
        ``(d,)`` float32, where they begin and the state before.
    sequences
        ``(s, t)`` int64 actions.
    dynamics, reward
        The models.
    """
    n, length = sequences.shape
    states = np.empty((n, length + 2, len(state)), np.float32)  # the previous state, this one, and those to come
    states[:, 0], states[:, 1] = previous, state
    for t in range(length):
        states[:, t + 2] = dynamics.predict(states[:, t + 1], states[:, t], sequences[:, t])
    now, before = (part.reshape(n * length, len(state)) for part in (states[:, 1:-1], states[:, :-2]))
    rewards = reward.predict(now, before, sequences.ravel()).reshape(n, length)
    return Scenarios(
        actions=sequences, states=states[:, 2:], rewards=rewards.astype(np.float32), values=np.zeros(n, np.float32)
    )
