"""What an environment itself says is where in a frame: the entry 'labels' of its observations, as ViZDoom has it."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec

from semrl.core import Labels
from semrl.core.errors import UsageError
from semrl.envs.actions import Env, title

ENTRY = "labels"
"""The entry of a dictionary of observations, ``(height, width)`` or ``(height, width, 1)`` uint8."""

_ASKED = {"Vizdoom": {"labels_buffer_enabled": True}}
"""What ids begin with → what asks their constructors for labels."""


def asking_labels(spec: EnvSpec) -> dict[str, Any]:
    """Return what to give an environment's constructor, so that it offers labels; nothing where it may do so anyway."""
    return next((settings for prefix, settings in _ASKED.items() if spec.id.startswith(prefix)), {})


def has_labels(space: gym.Space[Any]) -> bool:
    """Whether observations hold labels."""
    return isinstance(space, gym.spaces.Dict) and ENTRY in space.spaces and space[ENTRY].dtype == np.uint8


def require_labels(env: Env) -> None:
    """Check that an environment offers labels.

    Raises
    ------
    UsageError
        When it does not.
    """
    if not has_labels(env.unwrapped.observation_space):
        raise UsageError(f"{title(env)} offers no labels: its observations have no image 'labels' (environment.labels)")


def labels_of(env: Env, observation: dict[str, Any]) -> Labels:
    """Return the labels of an observation, and the classes of objects where the environment names them as ViZDoom does.

    ViZDoom's ``state.labels`` lists the objects that are seen, each with a ``value`` and an ``object_name``; there is
    no state at the end of an episode.
    """
    values = np.array(observation[ENTRY], np.uint8)
    objects = getattr(getattr(env.unwrapped, "state", None), "labels", None)
    classes = None if objects is None else {int(thing.value): str(thing.object_name) for thing in objects}
    return Labels(values=values.reshape(values.shape[:2]), classes=classes)
