"""Discrete worlds from pixels: operators learned in some layouts, plans carried out in others.

    python benchmarks/symbolic.py --worlds MiniGrid-FourRooms-v0 --decisions 600

Needs the extra `minigrid` for its worlds. Random play in the same layouts is the comparison.
"""

import contextlib
import json
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import machine
import numpy as np
import tyro

from semrl.envs import Game, make_env
from semrl.envs.environment import EnvironmentConfig
from semrl.evaluation.symbolic import UNSEEN_SEED, learn_world, play_plans


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Learn each world with each seed; solve layouts that were not seen."""

    worlds: tuple[str, ...] = ("MiniGrid-Empty-8x8-v0", "MiniGrid-FourRooms-v0")
    """Environments."""
    goal: str = "gain"
    """What is sought."""
    decisions: int = 600
    """To learn from."""
    seeds: int = 3
    """Of learning."""
    first_seed: int = 0
    """The first of these."""
    layouts: int = 20
    """That were not learned from, for each seed."""
    most: int = 200
    """Decisions after which a layout counts as not solved."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One world, learned once."""

    world: str
    seed: int
    operators: int
    seconds_learning: float
    layouts: int
    solved: int
    decisions: list[int | None]
    planned: list[int | None]
    solved_at_random: int | None
    """Of the same layouts; None where the goal is not a gain."""


def main(arguments: Arguments) -> None:
    """Learn, solve, tell."""
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    rows = [measured(world, seed, arguments) for world in arguments.worlds for seed in seeds]
    print(json.dumps({"machine": machine.describe(), **asdict(arguments), "rows": [asdict(row) for row in rows]}))


def measured(world: str, seed: int, arguments: Arguments) -> Row:
    """Learn a world and solve layouts of it."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        learn_world(world, decisions=arguments.decisions, seed=seed).save(Path(folder))
        seconds = time.process_time() - began
        first = UNSEEN_SEED + seed * arguments.layouts
        result = play_plans(folder, arguments.goal, trials=arguments.layouts, seed=first, max_decisions=arguments.most)
    chance = None if arguments.goal != "gain" else at_random(world, first, arguments)
    return Row(
        world=world,
        seed=seed,
        operators=result.operators,
        seconds_learning=round(seconds, 1),
        layouts=result.trials,
        solved=result.solved,
        decisions=result.decisions,
        planned=result.planned,
        solved_at_random=chance,
    )


def at_random(world: str, first: int, arguments: Arguments) -> int:
    """Return in how many layouts chance meets a gain."""
    rng, solved = np.random.default_rng(first), 0
    with contextlib.closing(make_env(world, EnvironmentConfig(frame_skip=1))) as env:
        game = Game(env, 0)
        for layout in range(arguments.layouts):
            game.begin(first + layout)
            for _ in range(arguments.most):
                outcome = game.step(int(rng.integers(game.n_actions)))
                if outcome.done or outcome.reward > 0:
                    solved += outcome.reward > 0
                    break
    return solved


if __name__ == "__main__":
    main(tyro.cli(Arguments))
