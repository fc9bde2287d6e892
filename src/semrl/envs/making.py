"""From an id to an environment, as `gymnasium.make` takes ids; what cannot be made is refused in one line."""

import difflib
import importlib
from typing import Any

import ale_py
import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from semrl.core.errors import MissingExtraError, NoEnvironmentError
from semrl.envs.actions import Env
from semrl.envs.pictures import is_seen
from semrl.envs.worlds import register_worlds

EXTRAS = {
    "minigrid": (("MiniGrid-", "BabyAI-"), "minigrid"),
    "vizdoom": (("Vizdoom",), "vizdoom.gymnasium_wrapper"),
}
"""Extra → what the ids of its environments begin with, and the module that makes them known to Gymnasium."""


def find_spec(env_id: str) -> EnvSpec:
    """Return what Gymnasium knows of an id, such as ``ALE/Pong-v5``, or ``module:Id-v0``, whose module is imported.

    Raises
    ------
    UsageError
        When it is unknown, its module cannot be imported, or it needs an extra that is not installed.
    """
    gym.register_envs(ale_py)
    register_worlds()
    module, _, name = env_id.rpartition(":")
    if module:
        _import(module, f"environment '{env_id}'")
    else:
        _import_extra(env_id)
    try:
        return gym.spec(name)
    except gym.error.Error:
        close = _similar(name)
        hint = f"; did you mean {close}?" if close else ""
        raise NoEnvironmentError(f"unknown environment '{env_id}'{hint}") from None


def make_seen(spec: EnvSpec, render_mode: str | None, **settings: Any) -> Env:
    """Make an environment so that there is something to be seen: where its observations are no images, rendered.

    Parameters
    ----------
    spec
        What Gymnasium knows of it.
    render_mode
        Gymnasium's; None to let this function decide.
    settings
        For its constructor.

    Raises
    ------
    UsageError
        When it cannot be made.
    """
    env = _make(spec, render_mode, settings)
    if render_mode is None and not is_seen(env) and "rgb_array" in (env.metadata.get("render_modes") or ()):
        env.close()
        env = _make(spec, "rgb_array", settings)
    return env


def is_atari(spec: EnvSpec) -> bool:
    """Whether this is a game of the Atari emulator."""
    return str(spec.entry_point).startswith("ale_py")


def _make(spec: EnvSpec, render_mode: str | None, settings: dict[str, Any]) -> Env:
    # Not every environment knows the word.
    rendered: dict[str, Any] = {} if render_mode is None else {"render_mode": render_mode}
    try:
        return gym.make(spec, disable_env_checker=True, **settings, **rendered)
    except Exception as error:  # a constructor may raise anything
        reason = (str(error).splitlines() or [""])[0]
        kind = "" if isinstance(error, (gym.error.Error, ImportError)) else f"{type(error).__name__}: "
        raise NoEnvironmentError(f"cannot make environment '{spec.id}': {kind}{reason}") from error


def _import(module: str, purpose: str) -> None:
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise NoEnvironmentError(
            f"there is no module '{error.name}', which {purpose} needs: install it, or set PYTHONPATH"
        ) from None
    except Exception as error:  # whatever stands in somebody's module
        raise NoEnvironmentError(f"cannot import '{module}' for {purpose}: {type(error).__name__}: {error}") from error


def _import_extra(env_id: str) -> None:
    """Import the optional package whose environments have such ids."""
    for extra, (prefixes, module) in EXTRAS.items():
        if env_id.startswith(prefixes) and env_id not in gym.registry:
            try:
                importlib.import_module(module)
            except ImportError:
                raise MissingExtraError(extra, f"environment '{env_id}'") from None


def _similar(env_id: str) -> str | None:
    """Return the environment that was likely meant, whatever the case; of an Atari game's name alone, the usual one."""
    known = {name.lower(): name for name in gym.registry}
    close = difflib.get_close_matches(env_id.lower(), known, n=1)
    return known.get(f"{env_id.lower()}noframeskip-v4") or (known[close[0]] if close else None)
