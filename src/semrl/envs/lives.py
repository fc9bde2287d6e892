"""Lives: whoever loses one is told so, since the score of many games does not say it."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np

from semrl.envs.actions import Env

LIVES = "lives"
"""Where an environment says how many are left, in its ``info``, as Atari's do."""
SIGNAL = "training_reward"
"""Where the ``info`` of `LifeLoss` says what is learned from in place of the reward."""


class LifeLoss(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Where a life is lost, let a loss be learned from in place of the reward; the reward itself stays.

    Parameters
    ----------
    env
        Says in its ``info`` how many lives are left; where none does, nothing is changed.
    loss
        What a lost life counts, above 0.
    """

    def __init__(self, env: Env, loss: float) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, loss=loss)
        super().__init__(env)
        self.loss = loss
        self._lives = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; see `gymnasium.Env.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._lives = _left(info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take a decision; see `gymnasium.Env.step`."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        before, self._lives = self._lives, _left(info)
        if self._lives < before:
            info = info | {SIGNAL: -self.loss * (before - self._lives)}
        return observation, float(reward), terminated, truncated, info


def _left(info: Mapping[str, Any]) -> int:
    """Return how many lives are left; 0 where an environment means something else by the word."""
    lives = info.get(LIVES)
    return int(lives) if isinstance(lives, int | np.integer) else 0
