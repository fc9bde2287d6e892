"""One game being played, as a thing that can be saved at any decision and continued elsewhere."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from semrl.core import Frame, Ints, Observation, Outcome
from semrl.core.arrays import Arrays, array_to_rng, rng_to_array
from semrl.core.errors import SemrlError, UsageError
from semrl.envs.actions import Env
from semrl.envs.lives import SIGNAL
from semrl.envs.pictures import newest_labels

LARGEST_REWARD = 1e18
"""Its square is still a number of float32, in which networks learn."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Played:
    """An episode, as far as it was played: its seed and ``(t,)`` actions. Played again it is the same."""

    seed: int
    actions: Ints


class Game:
    """An environment with a seed for every episode and a memory of the actions taken in it.

    A Gymnasium episode is a function of its seed and its actions, so these two are the emulator state
    that is saved: restoring plays them again (some 2,000 decisions a second for Atari) and compares
    the frame reached with the one saved. This holds for every environment, needs no opaque bytes, and
    gives back the screen as well, which an emulator's own snapshot leaves stale until the next step.

    Parameters
    ----------
    env
        As `make_env` returns it.
    seed
        Every episode's seed is drawn from a generator of this seed.
    """

    def __init__(self, env: Env, seed: int) -> None:
        self.env = env
        self.n_actions = int(env.action_space.n)  # type: ignore[attr-defined]
        self._rng = np.random.default_rng(seed)
        self._episode_seed = 0
        self._actions: list[int] = []
        self._frame: Any = None

    def reset(self) -> Observation:
        """Begin a new episode."""
        return self.begin(int(self._rng.integers(2**31)))

    def step(self, action: int) -> Outcome:
        """Take one decision; after the end of an episode call `reset`.

        Raises
        ------
        SemrlError
            When the reward is nothing to learn from.
        """
        self._actions.append(action)
        self._frame, given, terminated, truncated, info = self.env.step(action)
        when = f"decision {len(self._actions) - 1} of the episode of seed {self._episode_seed}"
        reward = checked_reward(given, when)
        return Outcome(
            observation=self._observation(),
            reward=reward,
            training_reward=info.get(SIGNAL, reward),
            terminated=terminated,
            truncated=truncated,
        )

    @property
    def played(self) -> Played:
        """This episode so far."""
        return Played(seed=self._episode_seed, actions=np.array(self._actions, dtype=np.int64))

    def to_arrays(self) -> Arrays:
        """Return the random generator, this episode's seed and actions, and the last frame."""
        frame = {} if self._frame is None else {"frame": self._frame}
        return {
            "rng": rng_to_array(self._rng),
            "episode_seed": np.array(self.played.seed),
            "actions": self.played.actions,
            **frame,
        }

    def from_arrays(self, arrays: Arrays) -> Observation | None:
        """Play the saved episode again up to the saved decision; return what is to be seen there.

        Returns None when no episode had begun.

        Raises
        ------
        SemrlError
            When the environment does not repeat itself, so that the run cannot be continued exactly.
        """
        self._rng = array_to_rng(arrays["rng"])
        if "frame" not in arrays:
            return None
        self.begin(int(arrays["episode_seed"]))
        for action in arrays["actions"].tolist():
            self.step(action)
        if not np.array_equal(self._frame, arrays["frame"]):
            raise SemrlError("the environment did not repeat itself from seed and actions; this run cannot be resumed")
        return self._observation()

    def begin(self, seed: int) -> Observation:
        """Begin the episode of a seed."""
        self._episode_seed = seed
        self._actions = []
        self._frame, _ = self.env.reset(seed=seed)
        return self._observation()

    def _observation(self) -> Observation:
        return observation_of(self.env, self._frame)


def observation_of(env: Env, frame: Frame) -> Observation:
    """Return what an environment shows now: a frame, the RAM of Atari games, labels where it offers them."""
    ale = getattr(env.unwrapped, "ale", None)
    if ale is not None:
        return Observation(frame=frame, ram=ale.getRAM())
    return Observation(frame=frame, labels=newest_labels(env))


def checked_reward(reward: Any, when: str) -> float:
    """Return a reward that can be learned from.

    Raises
    ------
    UsageError
        When it is not a number, not finite or too large: what is learned from it would be blamed instead.
    """
    try:
        number = float(reward)
    except (TypeError, ValueError):
        number = math.nan
    if abs(number) <= LARGEST_REWARD:
        return number
    raise UsageError(
        f"the environment gave the reward {reward} for {when}; "
        f"a reward must be a number from -{LARGEST_REWARD:g} to {LARGEST_REWARD:g}"
    )
