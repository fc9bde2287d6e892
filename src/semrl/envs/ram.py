"""What is known by hand about single Atari games: useful actions and where RAM keeps coordinates.

This is the only place that knows a game by name. Agents that see pixels never read it, except for
the choice of actions, which is a setting.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.errors import UsageError


@dataclass(frozen=True, kw_only=True, slots=True)
class GameFacts:
    """Hand-made knowledge of one game: its useful actions and the RAM address of each coordinate."""

    actions: tuple[str, ...]
    ram_addresses: dict[str, int]


# §3.1: both paddles' y, the ball's x and y. Addresses from the AtariARI benchmark (Anand et al. 2019).
GAMES = {
    "pong": GameFacts(
        actions=("RIGHT", "LEFT"),
        ram_addresses={"player_y": 51, "enemy_y": 50, "ball_x": 49, "ball_y": 54},
    ),
}


def ram_feature_names(game: str) -> tuple[str, ...]:
    """Return the names of the RAM features of a game, in the order of `ram_features`.

    Raises
    ------
    UsageError
        When the RAM of this game is not mapped, or it is no Atari game and has no name.
    """
    if game not in GAMES:
        known = ", ".join(sorted(GAMES))
        whose = f"the RAM of '{game}' is not mapped" if game else "this game has no mapped RAM"
        raise UsageError(f"{whose} (known: {known}); choose a model that sees pixels")
    return tuple(GAMES[game].ram_addresses)


def ram_features(game: str, ram: NDArray[np.uint8]) -> Floats:
    """Read the coordinates from the emulator's RAM (§3.1).

    Parameters
    ----------
    game
        Name of the ROM, such as ``"pong"``.
    ram
        ``(128,)`` uint8.

    Returns
    -------
    ``(k,)`` float32 in 0 … 1 (the byte divided by 255), in the order of `ram_feature_names`.
    """
    addresses = [GAMES[game].ram_addresses[name] for name in ram_feature_names(game)]
    return (ram[addresses] / np.float32(255)).astype(np.float32)
