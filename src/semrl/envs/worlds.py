"""Our own two worlds, made known to Gymnasium."""

from typing import Any

import gymnasium as gym

from semrl.envs.catch import Catch
from semrl.envs.maze import FourRooms


def register_worlds() -> None:
    """Make ``semrl/Catch-v0`` and ``semrl/FourRooms-v0`` known to `gymnasium.make`; again does no harm.

    `FourRooms` is truncated after 1000 steps.
    """
    worlds: dict[str, tuple[type[gym.Env[Any, Any]], int | None]] = {
        "semrl/Catch-v0": (Catch, None),
        "semrl/FourRooms-v0": (FourRooms, 1000),
    }
    for name, (world, steps) in worlds.items():
        if name not in gym.registry:
            gym.register(name, f"{world.__module__}:{world.__name__}", max_episode_steps=steps)
