"""Q-learning in a table (eq. 2.1)."""

from dataclasses import dataclass
from typing import Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, UsageError

Values = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class QLearningConfig:
    """How a `QLearning` learns and explores.

    Raises
    ------
    UsageError
        A value lies outside its range.
    """

    learning_rate: float = 0.5
    """α of eq. 2.1, the share of the temporal difference that is taken over, in 0 … 1."""

    discount: float = 0.99
    """γ of eq. 2.1, in 0 … 1; 1 is sound only where each episode comes to an end."""

    exploration: float = 0.1
    """ε, the share of actions taken at random, in 0 … 1."""

    def __post_init__(self) -> None:
        check_shares(learning_rate=self.learning_rate, discount=self.discount, exploration=self.exploration)


class QLearning:
    """One value for each state and action, learned by eq. 2.1, acting ε-greedily (§2.1).

    Values start at 0. Where all rewards are negative this is optimistic: whatever was not tried yet looks
    best, so that even a greedy learner tries everything.

    Parameters
    ----------
    config
        Learning rate, discount, exploration.
    n_states, n_actions
        States and actions are numbered from 0.

    Attributes
    ----------
    values_
        ``(n_states, n_actions)`` float64, the Q-table, in units of reward.
    """

    def __init__(self, config: QLearningConfig, *, n_states: int, n_actions: int) -> None:
        self.config = config
        self.values_: Values = np.zeros((n_states, n_actions))

    @property
    def n_values(self) -> int:
        """How many Q-values there are to learn."""
        return self.values_.size

    def act(self, state: int, rng: np.random.Generator) -> int:
        """Choose an action: at random with probability ε, else the `greedy` one."""
        if rng.random() < self.config.exploration:
            return int(rng.integers(self.values_.shape[1]))
        return self.greedy(state, rng)

    def greedy(self, state: int, rng: np.random.Generator) -> int:
        """Choose an action of the greatest value; among equals, at random."""
        return argmax(self.values_[state], rng)

    def update(self, state: int, action: int, reward: float, next_state: int, terminated: bool) -> None:
        """Learn from one step by eq. 2.1.

        There is no future after a terminal state: its value is 0, whatever `next_state` says. A truncated
        episode is not terminated.
        """
        future = 0.0 if terminated else float(self.values_[next_state].max())
        self.move_towards(state, action, reward + self.config.discount * future)

    def move_towards(self, state: int, action: int, target: float) -> None:
        """Move one value by α of its distance to `target`: the outer half of eq. 2.1."""
        old = self.values_[state, action]
        self.values_[state, action] = old + self.config.learning_rate * (target - old)

    def to_arrays(self) -> Arrays:
        """Return the table as ``"values"``."""
        return {"values": self.values_.copy()}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over a table of the same size.

        Raises
        ------
        DataError
            The table has another shape.
        """
        values = arrays["values"]
        if values.shape != self.values_.shape:
            raise DataError(f"the Q-table is {values.shape}, but this learner's is {self.values_.shape}")
        self.values_ = values.astype(np.float64)


class Learner(Protocol):
    """What learns in a table: `QLearning`, or `semrl_thesis.hierarchy.MazeHierarchy`."""

    def act(self, state: int, rng: np.random.Generator) -> int:
        """Choose an action."""

    def update(self, state: int, action: int, reward: float, next_state: int, terminated: bool) -> None:
        """Learn from one step."""


def train(
    learner: Learner,
    env: gym.Env[np.int64, np.int64],
    *,
    steps: int,
    rng: np.random.Generator,
) -> list[float]:
    """Let a learner act in a world with numbered states for a number of steps.

    Parameters
    ----------
    learner
        Learns in place.
    env
        Observes and takes the learner's states and actions; it is reset first, with a seed from `rng`.
    steps
        How many steps to take, over as many episodes as they last.
    rng
        Chooses the learner's exploration and the seed.

    Returns
    -------
    list of float
        The undiscounted return of each finished episode.
    """
    returns: list[float] = []
    state, _ = env.reset(seed=int(rng.integers(2**31)))
    total = 0.0
    for _ in range(steps):
        action = learner.act(int(state), rng)
        next_state, reward, terminated, truncated, _ = env.step(np.int64(action))
        learner.update(int(state), action, float(reward), int(next_state), terminated)
        total += float(reward)
        state = next_state
        if terminated or truncated:
            returns.append(total)
            state, _ = env.reset()
            total = 0.0
    return returns


def argmax(values: Values, rng: np.random.Generator) -> int:
    """Return the place of the greatest value; among equals, a random one."""
    best = np.flatnonzero(values == values.max())
    return int(rng.choice(best)) if len(best) > 1 else int(best[0])


def check_shares(**shares: float) -> None:
    """Raise `UsageError` unless each lies in 0 … 1."""
    for name, share in shares.items():
        if not 0 <= share <= 1:
            raise UsageError(f"{name} must lie in 0 … 1, not {share}")
