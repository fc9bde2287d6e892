"""What the lower line remembers: the episode that is going on, and past ones."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semrl.core import NO_ACTION, Floats, History, Ints, Trajectory, Transitions
from semrl.core.arrays import Arrays, arrays_to_ragged, nest, ragged_to_arrays, unnest
from semrl.core.kernels import compiled
from semrl.core.things import no_things

REWARD_LEAD = 16
"""Decisions before a reward that count as having led to it."""

EVERY_REWARD = np.ones(2, np.bool_)
"""Of what ends a scenario: a loss, and a gain."""

_END = -1  # stands for the action after the last state of an episode


@compiled
def discounted(rewards: Floats, ends: NDArray[np.bool_], discount: float) -> Floats:
    """Return the discounted sums of rewards, ``(n,)``, from each place to the next end."""
    returns, total = np.empty(len(rewards), np.float32), 0.0
    for i in range(len(rewards) - 1, -1, -1):
        total = 0.0 if ends[i] else rewards[i] + discount * total
        returns[i] = total
    return returns


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
        self._things: list[Floats] = []

    def add(self, state: Floats, action: int, reward: float, things: Floats | None = None) -> None:
        """Note a state, ``(d,)``, what was done in it and the reward for that, and what was seen in it."""
        self._things.append(no_things() if things is None else things)
        self._states.append(state)
        self._actions.append(action)
        self._rewards.append(reward)

    def __len__(self) -> int:
        """How many decisions were noted."""
        return len(self._actions)

    @property
    def last_reward(self) -> float:
        """What the newest decision brought; 0 before the first."""
        return self._rewards[-1] if self._rewards else 0.0

    def history(self, state: Floats, length: int, proposed: Ints, things: Floats | None = None) -> History:
        """Return where a plan from the present state, ``(d,)``, begins, with up to so many states and actions."""
        now = no_things() if things is None else things
        return History(
            states=np.array([state, *self._states[: -length - 1 : -1]][:length], dtype=np.float32),
            actions=np.array(self._actions[: -length - 1 : -1], dtype=np.int64),
            number=len(self),
            proposed=proposed,
            things=(now, *self._things[: -length - 1 : -1])[:length],
        )

    def so_far(self, last: Floats, things: Floats | None = None) -> Trajectory:
        """Return the episode up to the state ``last``, ``(d,)``, in which some things are seen."""
        return Trajectory(
            states=np.array([*self._states, last], dtype=np.float32),
            actions=np.array(self._actions, dtype=np.int64),
            rewards=np.array(self._rewards, dtype=np.float32),
            things=(*self._things, no_things() if things is None else things),
        )

    def clear(self) -> None:
        """Begin another episode."""
        self._states, self._actions, self._rewards, self._things = [], [], [], []

    def to_arrays(self) -> Arrays:
        """Return what was noted."""
        return {
            "states": np.array(self._states, dtype=np.float32).reshape(-1, self.dimension),
            "actions": np.array(self._actions, dtype=np.int64),
            "rewards": np.array(self._rewards, dtype=np.float64),
            **nest(things=ragged_to_arrays(self._things, like=no_things())),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self._states = list(arrays["states"])
        self._actions, self._rewards = arrays["actions"].tolist(), arrays["rewards"].tolist()
        things = unnest(arrays, "things")  # older checkpoints have none
        self._things = arrays_to_ragged(things) if things else [no_things()] * len(self._states)


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

    def episodes(self) -> Iterator[Trajectory]:
        """Yield what is remembered, episode by episode, the oldest first."""
        begin = 0
        for end in np.flatnonzero(self._actions == _END).tolist():
            own = slice(begin, end)
            yield Trajectory(
                states=self._states[begin : end + 1], actions=self._actions[own], rewards=self._rewards[own]
            )
            begin = end + 1

    def draw(self, rng: np.random.Generator, count: int, reward_share: float = 0.0) -> Transitions:
        """Draw decisions with replacement, uniformly but for a share of such as led to a reward soon."""
        drawn = rng.choice(self._decisions(), count)
        rewarded = np.flatnonzero(self._rewards)
        if len(rewarded):
            part = round(count * reward_share)
            soon = rng.choice(rewarded, part) - rng.integers(REWARD_LEAD, size=part)
            fit = (soon >= 0) & (self._actions[np.maximum(soon, 0)] != _END)
            drawn[:part][fit] = soon[fit]
        return self._at(drawn)

    def draw_balanced(self, rng: np.random.Generator, count: int) -> Transitions:
        """Draw about equally many decisions with a gain, a loss and neither, of those that were met."""
        decisions = self._decisions()
        signs = np.sign(self._rewards[decisions])
        kinds = [kind for kind in (decisions[signs == sign] for sign in (-1, 0, 1)) if len(kind)]
        shares = [len(part) for part in np.array_split(np.empty(count), len(kinds))]
        return self._at(np.concatenate([rng.choice(kind, n) for kind, n in zip(kinds, shares, strict=True)]))

    def joined(self, trajectory: Trajectory) -> "Experience":
        """Return all that is remembered and one more episode; this one stays as it is."""
        more = Experience(self.capacity, self._states.shape[1])
        more.from_arrays(self.to_arrays())
        more.add(trajectory)
        return more

    def windows(self, n_states: int, n_actions: int) -> tuple[Floats, Ints, Ints, Floats, Floats]:
        """Return every decision with what was before it.

        Returns
        -------
        tuple
            States, ``(n, n_states, d)``, and actions before, ``(n, n_actions)``, the newest first, as in
            `History`; action and reward, ``(n,)``; the next state, ``(n, d)``.
        """
        places = self._decisions()
        starts = np.concatenate([[0], np.flatnonzero(self._actions == _END)[:-1] + 1])
        first = starts[np.searchsorted(starts, places, side="right") - 1][:, None]  # of the same episode
        before = places[:, None] - np.arange(n_states)  # (n, n_states)
        earlier = places[:, None] - 1 - np.arange(n_actions)
        return (
            self._states[np.maximum(before, first)],
            np.where(earlier >= first, self._actions[np.maximum(earlier, 0)], NO_ACTION),
            self._actions[places],
            self._rewards[places],
            self._states[places + 1],
        )

    def ending(self, gap: int) -> NDArray[np.bool_]:
        """Tell whether a loss and whether a gain mostly ends what could be foreseen, ``(2,)``.

        It does unless most of its kind are followed by another reward within `gap` decisions: then the world goes on
        as if nothing had happened.
        """
        places, ending = np.flatnonzero(self._rewards), EVERY_REWARD.copy()
        episodes = np.cumsum(self._actions == _END)[places]
        followed = (np.diff(places) <= gap) & (np.diff(episodes) == 0)
        for gain in range(2):
            same = (self._rewards[places] > 0) == bool(gain)
            if same.any():
                ending[gain] = 2 * followed[same[:-1]].sum() <= same.sum()
        return ending

    def returns(self, discount: float) -> Floats:
        """Return the discounted signs of the rewards from every decision to the end of its episode, ``(n,)``."""
        ends = self._actions == _END
        returns = discounted(np.sign(self._rewards), ends, discount)
        kept: Floats = returns[~ends]
        return kept

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
