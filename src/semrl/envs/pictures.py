"""What is seen: RGB frames, whether an environment shows them, greys, or a dictionary, or can only be rendered."""

import sys
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import RecordConstructorArgs

from semrl.core import Image, Labels
from semrl.core.errors import UsageError
from semrl.envs.actions import Env, title
from semrl.envs.labelling import has_labels, labels_of

PREFERRED = ("image", "rgb", "pixels", "screen")
"""Entries of a dictionary of observations that are taken for the image, the first that is there."""


class ImageEntry(gym.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """Show one entry of a dictionary of observations.

    Parameters
    ----------
    env
        Its observations are dictionaries.
    key
        The entry that is an image.

    Attributes
    ----------
    labels : Labels or None
        What the newest observation says of objects; None where it says nothing.
    """

    def __init__(self, env: Env, key: str) -> None:
        RecordConstructorArgs.__init__(self, key=key)
        super().__init__(env)
        self.key = key
        self.labels: Labels | None = None
        self._labelled = has_labels(env.observation_space)
        assert isinstance(env.observation_space, gym.spaces.Dict)
        self.observation_space = env.observation_space[key]

    def observation(self, observation: Any) -> Any:
        """Return the image, and keep the labels."""
        if self._labelled:
            self.labels = labels_of(self.env, observation)
        return observation[self.key]


class GreyToRGB(gym.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """Show grey images, ``(height, width)`` or ``(height, width, 1)`` uint8, as RGB ones."""

    def __init__(self, env: Env) -> None:
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        shape = env.observation_space.shape
        assert shape is not None
        self.observation_space = gym.spaces.Box(0, 255, (*shape[:2], 3), np.uint8)

    def observation(self, observation: Any) -> Image:
        """Return three equal channels."""
        grey = np.asarray(observation)
        return np.repeat(grey.reshape(*grey.shape[:2], 1), 3, axis=2)


class RenderedFrames(gym.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """Show what an environment renders, ``(height, width, 3)`` uint8, instead of what it observes.

    Raises
    ------
    UsageError
        When it renders no RGB frame, or a package that it renders with is missing.
    """

    def __init__(self, env: Env) -> None:
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        env.reset(seed=0)
        try:
            frame = np.asarray(env.render())
        except (gym.error.DependencyNotInstalled, ImportError) as error:
            raise UsageError(f"{title(env)} cannot be rendered: {' '.join(str(error).split())}") from None
        if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
            raise UsageError(f"{title(env)} renders {frame.dtype} {frame.shape}, not RGB frames of uint8")
        self.observation_space = gym.spaces.Box(0, 255, frame.shape, np.uint8)

    def observation(self, observation: Any) -> Any:  # noqa: ARG002
        """Return the rendered frame."""
        return self.env.render()

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Send how it is made, where that is known: what it is drawn on cannot be sent."""
        spec = self.spec
        return super().__reduce_ex__(protocol) if spec is None else (_made_again, (spec,))


def _made_again(spec: EnvSpec) -> Env:
    return gym.make(spec, disable_env_checker=True)


class Checked(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Hold an environment to its word: each frame has the announced shape and type and stays what it was.

    Frames are copied, since some environments draw into the array that they returned before.

    Raises
    ------
    UsageError
        When a reset or a step returns something else than Gymnasium asks for, or an exception ends it.
    """

    def __init__(self, env: Env) -> None:
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._shape = env.observation_space.shape

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset; see `gymnasium.Env.reset`."""
        try:
            returned = self.env.reset(seed=seed, options=options)
        except Exception as error:
            raise self._failed("reset", error) from error
        if not isinstance(returned, tuple) or len(returned) != 2:
            raise UsageError(
                f"{title(self.env)}.reset must return an observation and a dictionary, as Gymnasium has it"
            )
        return self._frame(returned[0]), returned[1]

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step; see `gymnasium.Env.step`."""
        try:
            returned = self.env.step(action)
        except Exception as error:
            raise self._failed("step", error) from error
        if not isinstance(returned, tuple) or len(returned) != 5:
            raise UsageError(
                f"{title(self.env)}.step must return observation, reward, terminated, truncated and a dictionary, "
                "as Gymnasium has it"
            )
        observation, reward, terminated, truncated, info = returned
        return self._frame(observation), self._number(reward), bool(terminated), bool(truncated), info

    def _frame(self, frame: Any) -> Image:
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8 or frame.shape != self._shape:
            found = f"{frame.dtype} {frame.shape}" if isinstance(frame, np.ndarray) else f"a {type(frame).__name__}"
            raise UsageError(f"{title(self.env)} announces frames of uint8 {self._shape} and shows {found}")
        return frame.copy()

    def _number(self, reward: Any) -> float:
        if isinstance(reward, float):
            return reward
        value = np.asarray(reward)
        if value.size != 1 or value.dtype.kind not in "biuf":
            raise UsageError(f"{title(self.env)} pays {reward!r}, which is no number")
        return float(value.item())

    def _failed(self, what: str, error: Exception) -> UsageError:
        if isinstance(error, UsageError):
            return error
        return UsageError(f"{title(self.env)} failed in {what}: {type(error).__name__}: {error}")


def newest_labels(env: Env) -> Labels | None:
    """Return what the environment says of the objects in the newest frame; None where it says nothing."""
    layer = env
    while isinstance(layer, gym.Wrapper):
        if isinstance(layer, ImageEntry):
            return layer.labels
        layer = layer.env
    return None


def is_rgb(space: gym.Space[Any]) -> bool:
    """Whether a space is of RGB frames."""
    return _is_image(space) and len(space.shape or ()) == 3 and (space.shape or ())[2] == 3


def image_entry(space: gym.Space[Any], name: str) -> str | None:
    """Return which entry of a dictionary of observations is the image; None when there is none.

    Raises
    ------
    UsageError
        When several could be.
    """
    if not isinstance(space, gym.spaces.Dict):
        return None
    images = [key for key, entry in space.items() if _is_image(entry)]
    chosen = next((key for key in PREFERRED if key in images), images[0] if len(images) == 1 else None)
    if chosen is None and images:
        raise UsageError(f"{name} shows several images ({', '.join(images)}); call the one to be seen 'image'")
    return chosen


def is_seen(env: Env) -> bool:
    """Whether an environment's observations are or hold an image."""
    return _is_image(env.observation_space) or image_entry(env.observation_space, title(env)) is not None


def as_rgb(env: Env) -> Env:
    """Return the environment with RGB frames as observations.

    Parameters
    ----------
    env
        It shows RGB frames, grey images or a dictionary with one of them; or its render mode is ``"rgb_array"``.

    Raises
    ------
    UsageError
        When there is nothing to be seen, or more than one image.
    """
    env = _whole_grid(env)
    key = image_entry(env.observation_space, title(env))
    if key is not None:
        env = ImageEntry(env, key)
    elif not is_seen(env):
        if env.render_mode != "rgb_array":
            raise UsageError(f"{title(env)} shows {env.observation_space}, not RGB frames, and renders none")
        env = RenderedFrames(env)
    env = env if hasattr(env.unwrapped, "ale") else Checked(env)
    return env if is_rgb(env.observation_space) else GreyToRGB(env)


def _whole_grid(env: Env) -> Env:
    """Show a MiniGrid world as a picture: its own 'image' holds codes of things, not colours."""
    module = sys.modules.get("minigrid.minigrid_env")
    if module is None or not isinstance(env.unwrapped, module.MiniGridEnv):
        return env
    from minigrid.wrappers import RGBImgObsWrapper, RGBImgPartialObsWrapper

    layer = env
    while isinstance(layer, gym.Wrapper):
        if isinstance(layer, (RGBImgObsWrapper, RGBImgPartialObsWrapper)):
            return env
        layer = layer.env
    whole: Env = RGBImgObsWrapper(env)
    return whole


def _is_image(space: gym.Space[Any]) -> bool:
    if not isinstance(space, gym.spaces.Box) or space.dtype != np.uint8:
        return False
    return len(space.shape) == 2 or (len(space.shape) == 3 and space.shape[2] in (1, 3))
