"""The replay buffer: every observation is stored once, whatever is computed from it."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from semrl.agents.replay_kernels import Drawn, Ring, gather, stack
from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError

REWARD_WINDOW = 64
"""Decisions before a reward that count as having led to it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Batch:
    """Sampled n-step transitions.

    A state is the current and the previous observation, ``(b, 2, *shape)``: the agent sees the first
    and their difference (Fig. 3.8).
    """

    states: NDArray[Any]
    """Of the observations' dtype, as `next_states`."""
    plans: Floats
    """``(b, p)`` float32, features of the plans in these states."""
    actions: Ints
    """``(b,)`` int64."""
    returns: NDArray[np.float32]
    """``(b,)`` float32, discounted rewards of up to n steps."""
    next_states: NDArray[Any]
    next_plans: Floats
    discounts: NDArray[np.float32]
    """``(b,)`` float32, what the value of the next state counts: γ to the number of steps, 0 after the end."""
    advised: Ints
    """``(b,)`` int64, the actions that a planner proposed; −1 where there was no advice."""


class ReplayBuffer:
    """A ring of observations with the action, reward and end that followed each.

    The last observation of an episode is an entry as well, without an action: so a time limit can
    bootstrap from it, and every transition's next observation is the entry after it.

    Parameters
    ----------
    capacity
        Number of entries.
    shape, dtype
        Of one observation.
    plan_size
        Features of a plan that are stored beside it.
    """

    def __init__(self, capacity: int, shape: tuple[int, ...], dtype: DTypeLike, plan_size: int = 0) -> None:
        self.capacity = capacity
        self._shape = shape
        self._ring = Ring(
            observations=np.zeros((capacity, math.prod(shape)), dtype),
            plans=np.zeros((capacity, plan_size), np.float32),
            actions=np.full(capacity, -1, np.int16),
            advised=np.full(capacity, -1, np.int16),
            rewards=np.zeros(capacity, np.float32),
            terminated=np.zeros(capacity, np.bool_),
            starts=np.zeros(capacity, np.bool_),
        )
        self._count = 0  # entries ever written
        self._rewarded: list[Ints] | None = None  # entries of gains and of losses; None when they must be looked for

    def __len__(self) -> int:
        return min(self._count, self.capacity)

    def add(
        self,
        observation: NDArray[Any],
        plan: Floats,
        action: int,
        reward: float,
        *,
        terminated: bool,
        start: bool,
        advised: int | None = None,
    ) -> None:
        """Store an observation, its plan and what followed; ``start`` marks the first of an episode."""
        i = self._count % self.capacity
        if reward or self._ring.rewards[i]:
            self._rewarded = None
        advice = -1 if advised is None else advised
        entry = np.ravel(observation), plan, action, advice, reward, terminated, start
        parts: tuple[NDArray[Any], ...] = self._ring
        for part, value in zip(parts, entry, strict=True):
            part[i] = value
        self._count += 1

    def end_episode(self, observation: NDArray[Any], plan: Floats) -> None:
        """Store the last observation of an episode, after which no action was taken."""
        self.add(observation, plan, -1, 0.0, terminated=False, start=False)

    def sample(
        self,
        rng: np.random.Generator,
        size: int,
        *,
        n_steps: int,
        discount: float,
        reward_share: float = 0.0,
    ) -> Batch:
        """Draw transitions uniformly, with replacement; a share of them only from shortly before a reward.

        Returns over n steps (Sutton 1988) stop at the end of the episode and at the newest entry.
        """
        newest = self._count - 1
        oldest = max(0, self._count - self.capacity)
        ticks = self._draw(rng, size, oldest, newest)
        self._draw_rewarded(rng, ticks[: round(size * reward_share)], oldest, newest)
        gammas = np.float32(discount) ** np.arange(n_steps + 1, dtype=np.float32)
        drawn = self._room(size, n_steps)
        gather(self._ring, ticks, (oldest, newest), gammas, drawn)
        shape = (size, 2, *self._shape)
        return Batch(
            states=drawn.states.reshape(shape),
            plans=drawn.plans,
            actions=drawn.actions,
            returns=drawn.rewards.sum(axis=1, dtype=np.float32),
            next_states=drawn.next_states.reshape(shape),
            next_plans=drawn.next_plans,
            discounts=drawn.discounts,
            advised=drawn.advised,
        )

    def latest(self, count: int) -> tuple[NDArray[Any], Floats]:
        """Return states, ``(≤ count, 2, *shape)``, and plans, ``(≤ count, p)``, of the newest entries, oldest first."""
        oldest = max(0, self._count - self.capacity)
        ticks = np.arange(max(oldest, self._count - count), self._count)
        rows = np.empty((2 * len(ticks), self._ring.observations.shape[1]), self._ring.observations.dtype)
        stack(self._ring, ticks, oldest, rows)
        return rows.reshape(len(ticks), 2, *self._shape), self._ring.plans[ticks % self.capacity]

    def to_arrays(self) -> Arrays:
        """Return the filled part of the ring: views that the next `add` may change."""
        n = len(self)
        arrays: Arrays = {name: part[:n] for name, part in self._ring._asdict().items()}
        return {
            **arrays,
            "observations": arrays["observations"].reshape(n, *self._shape),
            "count": np.array(self._count),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over a ring of the same capacity and shape; a full one is not copied."""
        parts = {name: _extended(arrays[name], self.capacity) for name in Ring._fields}
        observations = parts["observations"].reshape(self._ring.observations.shape)
        self._ring = Ring(**{**parts, "observations": observations})
        self._count = int(arrays["count"])
        self._rewarded = None

    def _draw(self, rng: np.random.Generator, size: int, oldest: int, newest: int) -> Ints:
        """Draw entries that have an action and a successor."""
        if newest <= oldest:
            raise DataError("nothing to replay yet: the buffer needs an observation and the one after it")
        ticks = rng.integers(oldest, newest, size)
        while (bad := self._ring.actions[ticks % self.capacity] < 0).any():
            ticks[bad] = rng.integers(oldest, newest, int(bad.sum()))
        return ticks

    def _draw_rewarded(self, rng: np.random.Generator, ticks: Ints, oldest: int, newest: int) -> None:
        """Replace drawn entries by such as lie at most `REWARD_WINDOW` before a reward, where there are any.

        Gains and losses are drawn equally often, however rare one of them is.
        """
        if not len(ticks):
            return
        if self._rewarded is None:
            rewards = self._ring.rewards[: len(self)]
            self._rewarded = [np.flatnonzero(rewards > 0), np.flatnonzero(rewards < 0)]
        kinds = [kind for kind in self._rewarded if len(kind)]
        for kind, part in zip(kinds, np.array_split(ticks, len(kinds) or 1), strict=False):
            rewarded = newest - (newest - kind) % self.capacity  # entry → tick
            drawn = rng.choice(rewarded, len(part)) - rng.integers(REWARD_WINDOW, size=len(part))
            fit = (drawn >= oldest) & (drawn < newest) & (self._ring.actions[drawn % self.capacity] >= 0)
            part[fit] = drawn[fit]

    def _room(self, size: int, n_steps: int) -> Drawn:
        observations, plan_size = self._ring.observations, self._ring.plans.shape[1]
        states = np.empty((2, 2 * size, observations.shape[1]), observations.dtype)
        plans = np.empty((2, size, plan_size), np.float32)
        return Drawn(
            states=states[0],
            next_states=states[1],
            plans=plans[0],
            next_plans=plans[1],
            actions=np.empty(size, np.int64),
            advised=np.empty(size, np.int64),
            rewards=np.empty((size, n_steps), np.float32),
            discounts=np.empty(size, np.float32),
        )


def _extended(array: NDArray[Any], length: int) -> NDArray[Any]:
    """Return the rows of an array with room for more; the same memory where it is nobody else's."""
    if array.flags.owndata and array.flags.writeable and len(array) == length:
        return array  # images for 100,000 decisions take 700 MB: not twice
    extended = np.zeros((length, *array.shape[1:]), dtype=array.dtype)
    extended[: len(array)] = array
    return extended
