"""Goals in discrete worlds: how often plans with symbols meet them, beside chance and plans for the gain.

    python benchmarks/goals_grid.py FOLDER --json

Worlds and goals are in `goals_grid.toml`. Needs the extra `minigrid`. A goal that was missed is sought in the world
itself, by a search through all of its states.
"""

import contextlib
import copy
import json
import tomllib
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import machine
import numpy as np
import tyro
from rich.console import Console

from semrl.core.errors import UsageError
from semrl.envs import Game, make_env
from semrl.envs.environment import EnvironmentConfig
from semrl.evaluation.symbolic import UNSEEN_SEED, SymbolicWorld, learn_world, play_plans, read_symbolic_goal
from semrl.evaluation.symbolic.world import Record
from semrl.planning.symbolic.search import search

TABLE = Path(__file__).with_suffix(".toml")

Rival = Literal["random", "agent"]


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play for goals with plans, at random, and with plans for the gain."""

    folder: tyro.conf.Positional[Path]
    """Where what was learned of the worlds is kept."""
    trials: int = 20
    """Layouts of each goal, that were not learned from."""
    decisions: int = 100
    """After which a trial ends."""
    states: int = 50_000
    """Of the world that the search for a missed goal looks at."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One goal."""

    world: str
    goal: str
    against: bool
    reached: int
    median: float | None
    random: int
    agent: int
    missed_that_can_be_had: int
    """By the search."""
    trials: int


@dataclass(frozen=True, kw_only=True)
class Refused:
    """What came of a goal that cannot be had."""

    world: str
    goal: str
    reason: str | None
    """None where it was played for."""


def main(arguments: Arguments) -> None:
    """Learn, play, print."""
    console, rows, refused = Console(stderr=True), list[Row](), list[Refused]()
    for world, asked in tomllib.loads(TABLE.read_text()).items():
        run = arguments.folder / world
        if not run.exists():
            learn_world(world, decisions=asked["learn"]).save(run)
        for one in asked["goals"]:
            rows.append(measured(run, world, one, arguments))
            console.print(asdict(rows[-1]))
        refused += [Refused(world=world, goal=goal, reason=reason(run, goal)) for goal in asked["impossible"]]
    found = {"rows": [asdict(one) for one in rows], "refused": [asdict(one) for one in refused]}
    if arguments.json:
        print(json.dumps({"machine": machine.describe(), "trials": arguments.trials, **found}))
    else:
        Console().print(found)


def measured(run: Path, world: str, asked: dict[str, Any], arguments: Arguments) -> Row:
    """Play for one goal."""
    goal, trials, most = asked["goal"], arguments.trials, arguments.decisions
    result = play_plans(run, goal, trials=trials, max_decisions=most)
    took = sorted(one for one in result.decisions if one is not None)
    missed = [trial for trial, one in enumerate(result.decisions) if one is None]
    return Row(
        world=world,
        goal=goal,
        against=asked.get("against", False),
        reached=result.solved,
        median=took[len(took) // 2] if took else None,
        random=met_by(run, goal, "random", trials, most),
        agent=met_by(run, goal, "agent", trials, most),
        missed_that_can_be_had=sum(can_be_had(run, goal, trial, arguments.states) for trial in missed),
        trials=trials,
    )


def reason(run: Path, goal: str) -> str | None:
    """Return why a goal is refused before play; None where it is not."""
    try:
        play_plans(run, goal, trials=1)
    except UsageError as error:
        return str(error)
    return None


def met_by(run: Path, goal: str, who: Rival, trials: int, most: int) -> int:
    """Return in how many layouts chance, or who plans for the gain, meets a goal."""
    met, rng = 0, np.random.default_rng(0)
    with _layouts(run) as (game, world):
        concepts, operators = world.learn()
        gain = read_symbolic_goal("gain", concepts, operators)
        reached = _judge(world, goal)
        for trial in range(trials):
            record = Record(world.lattice.read(game.begin(UNSEEN_SEED + trial).frame))
            while not record.over and len(record.actions) < most:
                *_, state = concepts.states(record.grids)
                plan = search(operators, state, gain) if who == "agent" and state is not None else None
                action = plan.operators[0].action if plan else int(rng.integers(game.n_actions))
                record.take(game, action, world.lattice)
                if reached(record):
                    met += 1
                    break
    return met


def can_be_had(run: Path, goal: str, trial: int, most: int) -> bool:
    """Tell whether some actions meet a goal in a layout, by trying all in copies of the world, breadth first."""
    with _layouts(run) as (game, world):
        reached = _judge(world, goal)
        record = Record(world.lattice.read(game.begin(UNSEEN_SEED + trial).frame))
        waiting, seen = deque([(game.env, record)]), {record.grids[-1].tobytes()}
        while waiting and len(seen) < most:
            env, so_far = waiting.popleft()
            for action in range(game.n_actions):
                branch, longer = Game(copy.deepcopy(env), 0), copy.deepcopy(so_far)
                longer.take(branch, action, world.lattice)
                if reached(longer):
                    return True
                key = longer.grids[-1].tobytes()
                if key not in seen and not longer.over:
                    seen.add(key)
                    waiting.append((branch.env, longer))
    return False


def _judge(world: SymbolicWorld, goal: str) -> Callable[[Record], bool]:
    """Return what tells whether the newest decision of an episode met a goal, as the world says."""
    concepts, operators = world.learn()
    sought = read_symbolic_goal(goal, concepts, operators)

    def reached(record: Record) -> bool:
        if sought.event:
            return record.rewards[-1] > 0 if sought.event == "gain" else record.ended
        *_, before, state = [None, *concepts.states(record.grids)]
        return state is not None and sought.reached(None, before, state)

    return reached


@contextlib.contextmanager
def _layouts(run: Path) -> Iterator[tuple[Game, SymbolicWorld]]:
    world = SymbolicWorld.load(run)
    with contextlib.closing(make_env(world.env, EnvironmentConfig(frame_skip=1))) as env:
        yield Game(env, 0), world


if __name__ == "__main__":
    main(tyro.cli(Arguments))
