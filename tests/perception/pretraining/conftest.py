"""A world in which there is nothing to be seen."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest


class Dark(gym.Env[Any, Any]):
    """Black frames."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self.t = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.t = 0
        return np.zeros((84, 84, 3), np.uint8), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.t += 1
        return np.zeros((84, 84, 3), np.uint8), 0.0, self.t >= 40, False, {}


@pytest.fixture(autouse=True, scope="session")
def _dark() -> Iterator[None]:
    gym.register("semrl-tests/Dark-v0", Dark)
    yield
    gym.registry.pop("semrl-tests/Dark-v0")
