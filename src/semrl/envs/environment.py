"""Environments (§3.1): whatever Gymnasium can make and show, Atari games first."""

import contextlib
from dataclasses import dataclass, replace
from typing import Any, get_args

import ale_py
import gymnasium as gym
import numpy as np
from gymnasium.wrappers import StickyAction
from numpy.typing import NDArray

from semrl.core.errors import UsageError
from semrl.envs.actions import NOOP, Env, action_meanings, choose_actions, discrete, title
from semrl.envs.flicker import (
    Flicker,
    Ground,
    Pooling,
    background_of,
    brightest,
    farthest,
    flicker,
    look,
    needed_frames,
)
from semrl.envs.game import LARGEST_REWARD
from semrl.envs.labelling import asking_labels, require_labels
from semrl.envs.lives import LifeLoss
from semrl.envs.making import find_spec, is_atari, make_seen
from semrl.envs.pictures import as_rgb
from semrl.envs.variants import names_of, varied


@dataclass(frozen=True, kw_only=True)
class EnvironmentConfig:
    """How a game is played."""

    frame_skip: int = 4
    """Emulator frames for which each chosen action is held (§3.2.1); replaces a skip that the id itself asks for."""
    actions: tuple[str, ...] = ()
    """Names of the actions the agent may take; empty: RIGHT and LEFT in Pong (§3.1), else all the game offers."""
    sticky_actions: float | None = None
    """Probability that a frame repeats the previous action (Machado et al. 2018); None: as the id says."""
    max_frames: int = 1
    """Show what `pooling` makes of the last so many frames of a skip, for sprites that blink; 1: the last frame
    (§3.2.1); 0: as many as it takes, pooled as it takes, found out by random play when the environment is made."""
    pooling: Pooling = "brightest"
    """What of these frames is shown at each pixel: the brightest (Mnih et al. 2015), or what is farthest from the
    background that random play shows, for sprites that are darker than it."""
    max_noops: int = 0
    """At most so many random no-op decisions at the start of an episode, in games that have an action for it."""
    life_loss: float = 1.0
    """What a lost life counts as a loss, learned from in place of that decision's reward, in games with lives (Pong has
    none); scores stay the game's own."""
    labels: bool = False
    """Ask the environment to label the objects in each frame, for the detector 'labels'; ViZDoom's games do, at two
    thirds of their speed."""
    variant: str = ""
    """How the game is altered: names of `semrl.envs.variants` joined by +, such as lazy_enemy+recoloured."""

    def __post_init__(self) -> None:
        if self.frame_skip < 1:
            raise UsageError(f"frame_skip must be 1 or more, not {self.frame_skip}")
        if self.sticky_actions is not None and not 0 <= self.sticky_actions <= 1:
            raise UsageError(f"sticky_actions must lie between 0 and 1, not {self.sticky_actions}")
        if self.max_frames < 0:
            raise UsageError(f"max_frames must be 0 or more, not {self.max_frames}")
        if self.pooling not in get_args(Pooling):
            raise UsageError(f"pooling must be one of {', '.join(get_args(Pooling))}, not {self.pooling!r}")
        if self.max_noops < 0:
            raise UsageError(f"max_noops must be 0 or more, not {self.max_noops}")
        if not 0 <= self.life_loss <= LARGEST_REWARD:
            raise UsageError(f"life_loss must lie between 0 and {LARGEST_REWARD:g}, not {self.life_loss}")
        names_of(self.variant)


@dataclass(frozen=True, kw_only=True, slots=True)
class _Watched:
    """What random play shows: how much blinks by frames that are pooled, and the background."""

    by_frames: tuple[Flicker, ...]
    background: NDArray[np.uint8]


_WATCHED: dict[tuple[str, str, str, int] | None, _Watched] = {}


class FrameSkip(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Hold each action for a number of frames and sum the rewards; show what is pooled of the last few frames.

    Parameters
    ----------
    env
        Shows images.
    frames
        For which an action is held.
    max_frames
        Of these, so many at the end are pooled.
    pooling
        How. For the farthest from the background, the environment is played at random first; reset it afterwards.

    Attributes
    ----------
    seen : list
        What the environment showed at each frame of the newest step.
    """

    def __init__(self, env: Env, frames: int, max_frames: int = 1, pooling: Pooling = "brightest") -> None:
        gym.utils.RecordConstructorArgs.__init__(self, frames=frames, max_frames=max_frames, pooling=pooling)
        super().__init__(env)
        self.background = _watched(env, frames).background if pooling == "farthest" else None
        self.ground: Ground | None = None
        self.pooling = pooling
        self.frames = frames
        self.max_frames = max_frames
        self.seen: list[Any] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; see `gymnasium.Env.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        if self.background is not None:
            self.ground = Ground(self.background, observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Repeat the action; see `gymnasium.Env.step`."""
        total, self.seen = 0.0, []
        for _ in range(self.frames):
            observation, reward, terminated, truncated, info = self.env.step(action)
            self.seen.append(observation)
            if self.ground is not None:
                self.ground.see(observation)
            total += float(reward)
            if terminated or truncated:
                break
        return self._pooled(self.seen[-self.max_frames :]), total, terminated, truncated, info

    def _pooled(self, last: list[Any]) -> Any:
        if len(last) == 1:
            return last[0]
        return brightest(last) if self.ground is None else farthest(last, self.ground.colours)


class NoopStart(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Begin each episode with a random number of no-op decisions (Mnih et al. 2015)."""

    def __init__(self, env: Env, max_noops: int) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, max_noops=max_noops)
        super().__init__(env)
        self.max_noops = max_noops
        self.noop = int(getattr(env.action_space, "start", 0)) + action_meanings(env).index(NOOP)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset and wait; the number of no-ops follows from the seed."""
        observation, info = self.env.reset(seed=seed, options=options)
        for _ in range(int(self.np_random.integers(self.max_noops + 1))):
            observation, _, terminated, truncated, info = self.env.step(self.noop)
            if terminated or truncated:
                observation, info = self.env.reset(options=options)
        return observation, info


def make_env(
    env: str | Env = "PongNoFrameskip-v4",
    config: EnvironmentConfig | None = None,
    *,
    render_mode: str | None = None,
    every_frame: bool = False,
) -> Env:
    """Make a ready-to-play environment: RGB frames, frame skip, no-op starts, sticky actions, chosen actions.

    Parameters
    ----------
    env
        What `gymnasium.make` takes, an id or ``module:Id-v0``, or an environment that was made. What it shows may be
        RGB frames, grey images, or a dictionary with one image; what shows none but can be rendered is seen rendered.
        Of an environment that was made, one step counts as one frame.
        Its actions may be ``Discrete``, ``MultiDiscrete`` or ``MultiBinary``; the agent's count from 0.
    config
        How it is played; the default is the thesis's.
    render_mode
        Gymnasium's, for those who film or watch: ``"rgb_array"`` or ``"human"``.
    every_frame
        Whether `newest_frames` is to be asked: no emulator then skips frames by itself. The game is the same.

    Raises
    ------
    UsageError
        When the environment or an action is unknown, there is nothing to be seen or actions are not discrete.

    Examples
    --------
    >>> env = make_env("semrl/Catch-v0")
    >>> frame, info = env.reset(seed=0)
    >>> frame.shape
    (168, 168, 3)
    >>> action_meanings(env)
    ['LEFT', 'RIGHT']
    """
    config = config or EnvironmentConfig()
    # Silenced here, since an instance may be one of the emulator's, too.
    ale_py.ALEInterface.setLoggerMode(ale_py.LoggerMode.Error)
    if config.max_frames == 0:
        needed, pooling = _needed_frames(env, config)
        config = replace(config, max_frames=needed, pooling=pooling)
    if not isinstance(env, str):
        return _ready(env, config, skips=False)
    spec = find_spec(env)
    # The emulator skips frames and repeats actions itself, several times faster than a wrapper.
    skips = is_atari(spec) and config.max_frames == 1 and not config.variant and not every_frame
    settings = _emulated(config, skips=skips) if is_atari(spec) else {}
    made = make_seen(spec, render_mode, **settings, **(asking_labels(spec) if config.labels else {}))
    try:
        return _ready(made, config, skips=skips)
    except UsageError:
        made.close()
        raise


def pooled_frames(env: Env) -> tuple[int, Pooling]:
    """Return of how many frames of a skip this environment shows what is pooled, and how."""
    layer = env
    while isinstance(layer, gym.Wrapper):
        if isinstance(layer, FrameSkip):
            return min(layer.max_frames, layer.frames), layer.pooling
        layer = layer.env
    return 1, "brightest"


def newest_frames(env: Env) -> list[Any]:
    """Return what was shown at every frame of the newest decision; nothing where frames are skipped unseen."""
    layer = env
    while isinstance(layer, gym.Wrapper):
        if isinstance(layer, FrameSkip):
            return list(layer.seen)
        layer = layer.env
    return []


def blinking(env: Env, skip: int) -> float:
    """Return the share of what is lit that blinks and is not shown; the environment is to be reset afterwards."""
    frames, pooling = pooled_frames(env)
    if skip == 1 or (frames == skip and pooling == "farthest"):
        return 0.0
    return _watched(env, skip).by_frames[frames - 1].blinking


def sticky_actions(env: Env) -> float:
    """Return the probability with which a frame of this environment repeats the previous action."""
    layer = env
    while isinstance(layer, gym.Wrapper):
        if isinstance(layer, StickyAction):
            return float(layer.repeat_action_probability)
        layer = layer.env
    if not hasattr(layer, "ale"):
        return 0.0
    return round(float(layer.ale.getFloat("repeat_action_probability")), 6)  # the emulator keeps 32 bits


def _needed_frames(env: str | Env, config: EnvironmentConfig) -> tuple[int, Pooling]:
    """Return how many frames of a skip must be pooled, and how, as random play shows."""
    if config.frame_skip == 1:
        return 1, "brightest"
    if not isinstance(env, str):
        plain = _ready(env, replace(config, max_frames=1), skips=False)
        return needed_frames(_watched(plain, config.frame_skip).by_frames)
    with contextlib.closing(make_env(env, EnvironmentConfig(frame_skip=config.frame_skip))) as made:
        return needed_frames(_watched(made, config.frame_skip).by_frames)


def _watched(env: Env, skip: int) -> _Watched:
    """Look at every frame of random play; in a process, once for an id."""
    spec = env.spec
    key = (spec.id, repr(spec.entry_point), repr(spec.kwargs.get("game")), skip) if spec else None
    if key in _WATCHED:
        return _WATCHED[key]
    layer = env
    while not isinstance(layer, FrameSkip) and isinstance(layer, gym.Wrapper):
        layer = layer.env
    frames = look(layer.env if isinstance(layer, FrameSkip) else env, skip)
    measured = _Watched(by_frames=flicker(frames, pairs=True), background=background_of(frames))
    if key:
        _WATCHED[key] = measured
    return measured


def _emulated(config: EnvironmentConfig, *, skips: bool) -> dict[str, Any]:
    """Return the emulator's settings."""
    settings: dict[str, Any] = {"frameskip": config.frame_skip if skips else 1}
    if config.sticky_actions is not None:
        settings["repeat_action_probability"] = config.sticky_actions
    return settings


def _ready(env: Env, config: EnvironmentConfig, *, skips: bool) -> Env:
    """Add to an environment what it does not do itself."""
    if config.labels:
        require_labels(env)
    env = varied(as_rgb(env), config.variant)
    own, wanted = sticky_actions(env), config.sticky_actions
    if wanted is not None and wanted != own:
        if own:
            raise UsageError(f"{title(env)} has sticky actions of its own, {own:g}, which cannot be made {wanted:g}")
        env = StickyAction(env, wanted)
    if not skips and config.frame_skip > 1:
        env = FrameSkip(env, config.frame_skip, config.max_frames, config.pooling)
    env = discrete(env)
    if config.max_noops and NOOP in action_meanings(env):
        env = NoopStart(env, config.max_noops)
    if config.life_loss:
        env = LifeLoss(env, config.life_loss)
    return choose_actions(env, config.actions)
