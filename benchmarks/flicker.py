"""What blinks in each Atari game, and what is left unseen of it as the preset shows the game.

    python benchmarks/flicker.py [--games asteroids pong] [--decisions 200] [--json]

Random play with frame skip 4. A row a game: the share of lit pixels that blink and are not shown, for the maximum over
the last 1, 2, 3 and 4 frames; the same of all pixels that are lit in the four frames, moving things among them; the
trails that the maximum draws behind these; what ``max_frames = 0`` chooses from a short look of its own, frames and
pooling; and what blinks and is not shown with that, in play that was not looked at.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import ale_py
import gymnasium as gym
import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from semrl.envs import EnvironmentConfig, make_env
from semrl.envs.flicker import Flicker, Ground, Pooling, background_of, flicker, look, needed_frames, watch

SKIP = 4


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Measure what blinks."""

    games: tuple[str, ...] = ()
    """Names of ROMs [default: every game that Gymnasium knows]."""
    decisions: int = 200
    """Random decisions a game."""
    seed: int = 10
    """Of play, another than `make_env` looks at."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A game, as far as it was measured; `by_frames` holds the maximum over 1, 2, 3 and 4 frames."""

    game: str
    by_frames: tuple[Flicker, ...]
    chosen: int
    pooling: Pooling
    left: float


def main(arguments: Arguments) -> None:
    """Measure and print."""
    if arguments.json:
        rows = [asdict(row) for row in measure(arguments)]
        print(json.dumps({"machine": machine.describe(), "decisions": arguments.decisions, "games": rows}))
        return
    table = Table(
        "game", "blinking, unseen: 1", "2", "3", "4", "all unshown: 1", "2", "3", "4", "trails: 2", "3", "4", "chosen",
        "left", box=None, padding=(0, 1, 0, 0),
    )  # fmt: skip
    for row in measure(arguments):
        cells = [each.blinking for each in row.by_frames] + [each.unshown for each in row.by_frames]
        cells += [each.trails for each in row.by_frames[1:]]
        shares = [f"{100 * cell:.1f}" for cell in cells]
        table.add_row(row.game, *shares, f"{row.chosen} {row.pooling}", f"{100 * row.left:.2f}")
    Console(width=160).print(table)


def measure(arguments: Arguments) -> Iterator[Row]:
    """Measure game after game; those whose number of players or controls this emulator does not offer are not known."""
    gym.register_envs(ale_py)
    ids = {spec.kwargs["game"]: name for name, spec in gym.registry.items() if name.startswith("ALE/")}
    for game in arguments.games or sorted(ids):
        env = make_env(ids[game], EnvironmentConfig(sticky_actions=0.0))
        seen = look(env, SKIP)
        chosen, pooling = needed_frames(flicker(seen, pairs=True))
        play = watch(env, SKIP, arguments.seed, arguments.decisions)
        env.close()
        grounds = followed(play, background_of(seen)) if pooling == "farthest" else None
        yield Row(
            game=game, by_frames=flicker(play), chosen=chosen, pooling=pooling,
            left=flicker(play, grounds)[chosen - 1].blinking,
        )  # fmt: skip


def followed(play: NDArray[np.uint8], background: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """Return what is known to be behind everything at the end of each decision."""
    ground, grounds = Ground(background, play[0, 0]), []
    for decision in play:
        for frame in decision:
            ground.see(frame)
        grounds.append(ground.colours.copy())
    return grounds


if __name__ == "__main__":
    main(tyro.cli(Arguments))
