"""Our own worlds, made known to Gymnasium."""

from typing import Any

import gymnasium as gym

from semrl.envs.catch import Catch
from semrl.envs.maze import DrawnFourRooms, FourRooms


def register_worlds() -> None:
    """Make ``semrl/Catch-v0``, ``semrl/FourRooms-v0`` and ``semrl/DrawnFourRooms-v0`` known to `gymnasium.make`.

    Again does no harm. The labyrinths are truncated after 1000 steps.
    """
    worlds: dict[str, tuple[type[gym.Env[Any, Any]], int | None]] = {
        "semrl/Catch-v0": (Catch, None),
        "semrl/FourRooms-v0": (FourRooms, 1000),
        "semrl/DrawnFourRooms-v0": (DrawnFourRooms, 1000),
    }
    for name, (world, steps) in worlds.items():
        if name not in gym.registry:
            gym.register(name, f"{world.__module__}:{world.__name__}", max_episode_steps=steps)
