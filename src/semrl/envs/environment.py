"""Environments (§3.1): any Gymnasium environment that shows RGB frames, Atari games first."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import ale_py
import gymnasium as gym
import numpy as np
from gymnasium.wrappers import StickyAction, TransformAction

from semrl.core.errors import UsageError
from semrl.envs.ram import GAMES
from semrl.envs.worlds import register_worlds

Env = gym.Env[Any, Any]

NOOP = "NOOP"
"""Name of the action that waits."""


@dataclass(frozen=True, kw_only=True)
class EnvironmentConfig:
    """How a game is played."""

    frame_skip: int = 4
    """Emulator frames for which each chosen action is held (§3.2.1)."""
    actions: tuple[str, ...] = ()
    """Names of the actions the agent may take; empty: RIGHT and LEFT in Pong (§3.1), else all the game offers."""
    sticky_actions: float = 0.0
    """Probability that a frame repeats the previous action (Machado et al. 2018)."""
    max_noops: int = 0
    """At most so many random no-op decisions at the start of an episode, in games that have an action for it."""

    def __post_init__(self) -> None:
        if self.frame_skip < 1:
            raise UsageError(f"frame_skip must be 1 or more, not {self.frame_skip}")
        if not 0 <= self.sticky_actions <= 1:
            raise UsageError(f"sticky_actions must lie between 0 and 1, not {self.sticky_actions}")
        if self.max_noops < 0:
            raise UsageError(f"max_noops must be 0 or more, not {self.max_noops}")


class FrameSkip(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Hold each action for a number of frames and sum the rewards; for games that cannot do it themselves."""

    def __init__(self, env: Env, frames: int) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, frames=frames)
        super().__init__(env)
        self.frames = frames

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Repeat the action; see `gymnasium.Env.step`."""
        total = 0.0
        for _ in range(self.frames):
            observation, reward, terminated, truncated, info = self.env.step(action)
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, info


class NoopStart(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Begin each episode with a random number of no-op decisions (Mnih et al. 2015)."""

    def __init__(self, env: Env, max_noops: int) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, max_noops=max_noops)
        super().__init__(env)
        self.max_noops = max_noops
        self.noop = action_meanings(env).index(NOOP)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset and wait; the number of no-ops follows from the seed."""
        observation, info = self.env.reset(seed=seed, options=options)
        for _ in range(int(self.np_random.integers(self.max_noops + 1))):
            observation, _, terminated, truncated, info = self.env.step(self.noop)
            if terminated or truncated:
                observation, info = self.env.reset(options=options)
        return observation, info


def action_meanings(env: Env) -> list[str]:
    """Return the names of an environment's actions; their numbers where it has no names."""
    if hasattr(env.unwrapped, "get_action_meanings"):
        return list(env.unwrapped.get_action_meanings())
    return [str(i) for i in range(env.action_space.n)]  # type: ignore[attr-defined]


def played_actions(env: Env, names: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of the actions that are played: those that are named, else what is known to be enough."""
    rom = rom_name(env)
    return tuple(names or (GAMES[rom].actions if rom in GAMES else action_meanings(env)))


def rom_name(env: Env) -> str | None:
    """Return the name of an Atari game's ROM, such as ``"pong"``; None for other environments."""
    game = (env.spec.kwargs if env.spec else {}).get("game")
    return str(game) if game and hasattr(env.unwrapped, "ale") else None


def make_env(
    env_id: str = "PongNoFrameskip-v4", config: EnvironmentConfig | None = None, *, render_mode: str | None = None
) -> Env:
    """Make a ready-to-play environment: frame skip, no-op starts, sticky actions, chosen actions.

    Parameters
    ----------
    env_id
        A registered Gymnasium environment whose observations are RGB frames.
    config
        How it is played; the default is the thesis's.
    render_mode
        Gymnasium's, for those who film or watch: ``"rgb_array"`` or ``"human"``.

    Raises
    ------
    UsageError
        When the environment or an action is unknown, frames are no RGB images or actions not discrete.
    """
    config = config or EnvironmentConfig()
    env = _make_base(env_id, config, render_mode)
    _check_spaces(env_id, env)
    if config.max_noops and NOOP in action_meanings(env):
        env = NoopStart(env, config.max_noops)
    return choose_actions(env, config.actions)


def _make_base(env_id: str, config: EnvironmentConfig, render_mode: str | None) -> Env:
    """Make the environment with its frame skip and sticky actions."""
    # Not every environment knows the word.
    rendered: dict[str, Any] = {} if render_mode is None else {"render_mode": render_mode}
    ale_py.ALEInterface.setLoggerMode(ale_py.LoggerMode.Error)
    gym.register_envs(ale_py)
    register_worlds()
    try:
        spec = gym.spec(env_id)
    except gym.error.Error:
        close = _similar(env_id)
        hint = f"; did you mean {close}?" if close else ""
        raise UsageError(f"unknown environment '{env_id}'{hint}") from None
    try:
        if str(spec.entry_point).startswith("ale_py"):
            # The emulator skips frames and repeats actions itself, several times faster than a wrapper.
            return gym.make(
                env_id,
                frameskip=config.frame_skip,
                repeat_action_probability=config.sticky_actions,
                disable_env_checker=True,
                **rendered,
            )
        env = gym.make(env_id, disable_env_checker=True, **rendered)
    except (gym.error.Error, ImportError) as error:
        raise UsageError(f"cannot make environment '{env_id}': {str(error).splitlines()[0]}") from None
    if config.sticky_actions:
        env = StickyAction(env, config.sticky_actions)
    return FrameSkip(env, config.frame_skip) if config.frame_skip > 1 else env


def _similar(env_id: str) -> str | None:
    """Return the environment that was likely meant, whatever the case; of an Atari game's name alone, the usual one."""
    known = {name.lower(): name for name in gym.registry}
    close = difflib.get_close_matches(env_id.lower(), known, n=1)
    return known.get(f"{env_id.lower()}noframeskip-v4") or (known[close[0]] if close else None)


def _check_spaces(env_id: str, env: Env) -> None:
    space = env.observation_space
    if not (
        isinstance(space, gym.spaces.Box) and space.dtype == np.uint8 and len(space.shape) == 3 and space.shape[2] == 3
    ):
        raise UsageError(f"{env_id} shows {space}, not RGB frames (height, width, 3) of uint8")
    if not isinstance(env.action_space, gym.spaces.Discrete):
        raise UsageError(f"{env_id} has actions {env.action_space}; only discrete ones can be learned")


def choose_actions(env: Env, names: Sequence[str] = ()) -> Env:
    """Keep only the named actions, or what is known to be enough, renumbered from 0.

    Raises
    ------
    UsageError
        When there is no such action.
    """
    meanings = action_meanings(env)
    names = played_actions(env, names)
    unknown = [name for name in names if name not in meanings]
    if unknown:
        game = env.spec.id if env.spec else env
        raise UsageError(f"{game} has no action {', '.join(unknown)}; it has {', '.join(meanings)}")
    chosen = [meanings.index(name) for name in names]
    return TransformAction(env, lambda action: chosen[int(action)], gym.spaces.Discrete(len(chosen)))
