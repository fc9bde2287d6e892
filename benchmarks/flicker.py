"""What blinks in each Atari game, and over how many frames of a skip the maximum must go so that it is seen.

    python benchmarks/flicker.py [--games asteroids pong] [--decisions 200] [--json]

Random play with frame skip 4. A row a game: the share of lit pixels that blink and are not shown, for the maximum over
the last 1, 2, 3 and 4 frames; the same of all pixels that are lit in the four frames, moving things among them; the
trails that the maximum draws behind these; and what ``max_frames = 0`` chooses.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import ale_py
import gymnasium as gym
import machine
import tyro
from rich.console import Console
from rich.table import Table

from semrl.envs import EnvironmentConfig, make_env
from semrl.envs.flicker import Flicker, flicker, needed_frames, watch

SKIP = 4


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Measure what blinks."""

    games: tuple[str, ...] = ()
    """Names of ROMs [default: every game that Gymnasium knows]."""
    decisions: int = 200
    """Random decisions a game."""
    seed: int = 0
    """Of play."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A game, as far as it was measured; `by_frames` holds the maximum over 1, 2, 3 and 4 frames."""

    game: str
    by_frames: tuple[Flicker, ...]
    chosen: int


def main(arguments: Arguments) -> None:
    """Measure and print."""
    if arguments.json:
        rows = [asdict(row) for row in measure(arguments)]
        print(json.dumps({"machine": machine.describe(), "decisions": arguments.decisions, "games": rows}))
        return
    table = Table(
        "game", "blinking, unseen: 1", "2", "3", "4", "all unshown: 1", "2", "3", "4", "trails: 2", "3", "4", "chosen",
        box=None, padding=(0, 1, 0, 0),
    )  # fmt: skip
    for row in measure(arguments):
        cells = [each.blinking for each in row.by_frames] + [each.unshown for each in row.by_frames]
        cells += [each.trails for each in row.by_frames[1:]]
        table.add_row(row.game, *(f"{100 * cell:.1f}" for cell in cells), str(row.chosen))
    Console(width=140).print(table)


def measure(arguments: Arguments) -> Iterator[Row]:
    """Measure game after game; those whose number of players or controls this emulator does not offer are not known."""
    gym.register_envs(ale_py)
    ids = {spec.kwargs["game"]: name for name, spec in gym.registry.items() if name.startswith("ALE/")}
    for game in arguments.games or sorted(ids):
        env = make_env(ids[game], EnvironmentConfig(sticky_actions=0.0))
        measured = flicker(watch(env, SKIP, arguments.seed, arguments.decisions))
        env.close()
        yield Row(game=game, by_frames=measured, chosen=needed_frames(measured))


if __name__ == "__main__":
    main(tyro.cli(Arguments))
