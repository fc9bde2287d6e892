"""What the lower line remembers: the episode that is going on, and past ones."""

import numpy as np
from numpy.typing import NDArray

from semrl.arrays import Arrays
from semrl.types import Floats, Ints, Trajectory, Transitions

_END = -1  # stands for the action after the last state of an episode


class EpisodeRecord:
    """The episode that is going on.

    Parameters
    ----------
    dimension
        Length of a state.
    """

    def __init__(self, dimension: int) -> None:
        self.dimension = dimension
        self._states: list[Floats] = []
        self._actions: list[int] = []
        self._rewards: list[float] = []

    def add(self, state: Floats, action: int, reward: float) -> None:
        """Note a state, ``(d,)``, what was done in it and the reward for that."""
        self._states.append(state)
        self._actions.append(action)
        self._rewards.append(reward)

    def finish(self, last: Floats) -> Trajectory:
        """Return the episode, whose last state is ``last``, and begin another."""
        trajectory = Trajectory(
            states=np.array([*self._states, last], dtype=np.float32),
            actions=np.array(self._actions, dtype=np.int64),
            rewards=np.array(self._rewards, dtype=np.float32),
        )
        self.from_arrays(EpisodeRecord(self.dimension).to_arrays())
        return trajectory

    def to_arrays(self) -> Arrays:
        """Return what was noted."""
        return {
            "states": np.array(self._states, dtype=np.float32).reshape(-1, self.dimension),
            "actions": np.array(self._actions, dtype=np.int64),
            "rewards": np.array(self._rewards, dtype=np.float64),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self._states = list(arrays["states"])
        self._actions, self._rewards = arrays["actions"].tolist(), arrays["rewards"].tolist()


class Experience:
    """The newest episodes, rehearsed so that the models do not forget them (Robins 1995); each state is stored once.

    Parameters
    ----------
    capacity
        States kept; whole episodes go, oldest first, but the newest always stays.
    dimension
        Length of a state.
    """

    def __init__(self, capacity: int, dimension: int) -> None:
        self.capacity = capacity
        self._states = np.zeros((0, dimension), np.float32)
        self._actions = np.zeros(0, np.int64)
        self._rewards = np.zeros(0, np.float32)

    def __len__(self) -> int:
        """How many decisions can be drawn."""
        return int((self._actions != _END).sum())

    def add(self, trajectory: Trajectory) -> None:
        """Remember an episode."""
        self._states = np.concatenate([self._states, trajectory.states])
        self._actions = np.append(self._actions, [*trajectory.actions, _END])
        self._rewards = np.append(self._rewards, [*trajectory.rewards, 0]).astype(np.float32)
        ends = np.flatnonzero(self._actions == _END)
        left = len(self._actions) - 1 - ends  # (episodes,) states that stay when all up to this end go
        surplus = (len(self._actions) > self.capacity) & (left > 0)
        if surplus.any():
            fitting = np.flatnonzero(surplus & (left <= self.capacity))
            first = ends[fitting[0] if len(fitting) else np.flatnonzero(surplus)[-1]] + 1
            self._states, self._actions = self._states[first:], self._actions[first:]
            self._rewards = self._rewards[first:]

    def draw(self, rng: np.random.Generator, count: int) -> Transitions:
        """Draw decisions uniformly, with replacement."""
        return self._at(rng.choice(self._decisions(), count))

    def draw_balanced(self, rng: np.random.Generator, count: int) -> Transitions:
        """Draw about equally many decisions with a gain, a loss and neither, of those that were met."""
        decisions = self._decisions()
        signs = np.sign(self._rewards[decisions])
        kinds = [kind for kind in (decisions[signs == sign] for sign in (-1, 0, 1)) if len(kind)]
        shares = [len(part) for part in np.array_split(np.empty(count), len(kinds))]
        return self._at(np.concatenate([rng.choice(kind, n) for kind, n in zip(kinds, shares, strict=True)]))

    def to_arrays(self) -> Arrays:
        """Return all that is remembered."""
        return {"states": self._states, "actions": self._actions, "rewards": self._rewards}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self._states, self._actions, self._rewards = (arrays[name] for name in ("states", "actions", "rewards"))

    def _decisions(self) -> Ints:
        return np.flatnonzero(self._actions != _END)

    def _at(self, places: NDArray[np.int64]) -> Transitions:
        begins = (places == 0) | (self._actions[places - 1] == _END)
        return Transitions(
            states=self._states[places],
            previous=self._states[np.where(begins, places, places - 1)],
            actions=self._actions[places],
            rewards=self._rewards[places],
            next_states=self._states[places + 1],
        )
