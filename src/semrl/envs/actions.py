"""Actions: every discrete action space as numbers from 0, each with a name; the environment receives its own."""

import enum
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from semrl.core.errors import UsageError
from semrl.envs.ram import GAMES

Env = gym.Env[Any, Any]

NOOP = "NOOP"
"""Name of the action that waits."""

MOST_COMBINATIONS = 1024
"""Actions that a space of several choices may have when every combination is an action of its own."""


def action_meanings(env: Env) -> list[str]:
    """Return the names of an environment's actions, by number: all differ; without names they are the numbers.

    Names may be given by a method ``get_action_meanings`` (a sequence, or a mapping from numbers) or by an enumeration
    ``actions``; they may be strings, numbers or members of an enumeration.
    """
    space = env.action_space
    start, n = (int(space.start), int(space.n)) if isinstance(space, gym.spaces.Discrete) else (0, 0)
    names = [_name(name) for name in _given_names(env, start)]
    if len(names) != n:
        names = [str(start + i) for i in range(n)]
    return [name if name and names.count(name) == 1 else f"{name} ({start + i})" for i, name in enumerate(names)]


def _given_names(env: Env, start: int) -> Iterable[Any]:
    """Return what an environment says of its actions, in the order of their numbers."""
    if env.has_wrapper_attr("get_action_meanings"):
        given = env.get_wrapper_attr("get_action_meanings")()
        return [given.get(start + i, "") for i in range(len(given))] if isinstance(given, Mapping) else given
    buttons, combinations = _buttons(env), getattr(env.unwrapped, "button_map", ())
    if combinations and len(buttons) == len(combinations[0]):
        return [_pressed(buttons, combination) for combination in combinations]
    members = getattr(env.unwrapped, "actions", None)
    return members if isinstance(members, type) and issubclass(members, enum.Enum) else ()


def _name(given: Any) -> str:
    return given.name if isinstance(given, enum.Enum) else str(given)


def rom_name(env: Env) -> str | None:
    """Return the name of an Atari game's ROM, such as ``"pong"``; None for other environments."""
    game = (env.spec.kwargs if env.spec else {}).get("game")
    return str(game) if game and hasattr(env.unwrapped, "ale") else None


class CombinedActions(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Make every combination of several choices one action: ``MultiDiscrete`` and ``MultiBinary`` become discrete.

    Combinations are numbered as in a nested loop, the last choice fastest. Their names are the choices, joined by
    commas, such as ``"2,0"``; where the environment names its buttons, those that are pressed, such as
    ``"ATTACK+MOVE_LEFT"``, and ``"NOOP"``.

    Raises
    ------
    UsageError
        When there are more than `MOST_COMBINATIONS`.
    """

    def __init__(self, env: Env) -> None:
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        space = env.action_space
        if isinstance(space, gym.spaces.MultiBinary):
            sizes, starts = np.full(int(np.prod(space.shape)), 2), np.zeros(space.shape, np.int64)
        else:
            assert isinstance(space, gym.spaces.MultiDiscrete)
            sizes, starts = space.nvec.ravel(), getattr(space, "start", np.zeros(space.shape, np.int64))
        n = int(np.prod(sizes.astype(object)))
        if n > MOST_COMBINATIONS:
            raise UsageError(f"{title(env)} has {n:,} combinations of actions, more than {MOST_COMBINATIONS:,}")
        choices = np.stack(np.unravel_index(np.arange(n), tuple(sizes.tolist())), axis=1)
        self._choices = (choices.reshape(n, *starts.shape) + starts).astype(space.dtype)
        self.action_space = gym.spaces.Discrete(n)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take the choices that this number stands for."""
        return self.env.step(self._choices[int(action)].copy())

    def get_action_meanings(self) -> list[str]:
        """Return the names of the combinations."""
        buttons = _buttons(self.env)
        rows = self._choices.reshape(len(self._choices), -1).tolist()
        if len(buttons) != len(rows[0]):
            return [",".join(map(str, row)) for row in rows]
        return [_pressed(buttons, row) for row in rows]


def _buttons(env: Env) -> list[str]:
    """Return the names of an environment's buttons, where it offers them as ViZDoom does."""
    game = getattr(env.unwrapped, "game", None)
    buttons: list[Any] = getattr(game, "get_available_buttons", list)()
    return [button.name for button in buttons]


def _pressed(buttons: Sequence[str], row: Sequence[Any]) -> str:
    return "+".join(button for button, down in zip(buttons, row, strict=True) if down) or NOOP


class ChosenActions(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Keep some actions, numbered from 0; the environment receives its own numbers.

    Parameters
    ----------
    env
        Its actions are discrete.
    chosen
        Numbers of the actions that are kept, from 0 whatever the environment's first number is.
    """

    def __init__(self, env: Env, chosen: Sequence[int]) -> None:
        RecordConstructorArgs.__init__(self, chosen=list(chosen))
        super().__init__(env)
        names, start = action_meanings(env), int(getattr(env.action_space, "start", 0))
        self._numbers = [start + i for i in chosen]
        self._names = [names[i] for i in chosen]
        self.action_space = gym.spaces.Discrete(len(self._numbers))

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take the action that this number stands for."""
        return self.env.step(self._numbers[int(action)])

    def get_action_meanings(self) -> list[str]:
        """Return the names of the actions that are kept."""
        return list(self._names)


def choose_actions(env: Env, names: Sequence[str] = ()) -> Env:
    """Keep only the named actions, or what is known to be enough, renumbered from 0.

    Raises
    ------
    UsageError
        When there is no such action.
    """
    meanings, rom = action_meanings(env), rom_name(env)
    names = names or (GAMES[rom].actions if rom in GAMES else meanings)
    unknown = [name for name in names if name not in meanings]
    if unknown:
        raise UsageError(f"{title(env)} has no action {', '.join(unknown)}; it has {', '.join(meanings)}")
    return ChosenActions(env, [meanings.index(name) for name in names])


def discrete(env: Env) -> Env:
    """Return an environment whose actions are discrete.

    Raises
    ------
    UsageError
        When they are continuous or too many.
    """
    space = env.action_space
    if isinstance(space, (gym.spaces.MultiDiscrete, gym.spaces.MultiBinary)):
        return CombinedActions(env)
    if not isinstance(space, gym.spaces.Discrete):
        raise UsageError(f"{title(env)} has actions {space}; only discrete ones can be learned")
    return env


def title(env: Env) -> str:
    """Return what an environment is called in messages: its id, or its class."""
    return env.spec.id if env.spec else type(env.unwrapped).__name__
