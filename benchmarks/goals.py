"""Goals that a run was never trained for: how often they are reached, beside chance and who was trained for the reward.

    python benchmarks/goals.py RUN --json

The goals of each game are in `goals.toml`. A trial that was missed is searched from its start in the emulator itself.
"""

import json
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import goal_oracle
import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.core.errors import UsageError
from semrl.evaluation.goals import GoalPolicy, GoalWatch, goal_trials
from semrl.training.folder import RunFolder
from semrl.training.loop import Step

TABLE = Path(__file__).with_suffix(".toml")

RIVALS: tuple[GoalPolicy, ...] = ("random", "agent")

CONDITIONS = ("hold", "until", "avoid")


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play ten goals with plans for them, at random, and with the agent as trained."""

    run: tyro.conf.Positional[Path]
    """A trained run with a map, of a game of the table."""
    trials: int = 20
    """Of each goal."""
    courses: int = 60
    """That the search plays at most from the start of a trial that was missed; 0: none."""
    only: tuple[int, ...] = ()
    """Numbers of goals, from 0; all when there are none."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One goal."""

    goal: str
    conditions: dict[str, object]
    against: bool
    """Whether it costs reward."""
    reached: int
    median: float | None
    """Decisions of the trials that reached it."""
    rivals: dict[str, int]
    """Chance and the agent: trials in which they happen to reach it."""
    missed: dict[int, bool]
    """Trial that was missed → whether the search reaches the goal from its start."""
    trials: int


def main(arguments: Arguments) -> None:
    """Play, and print a table."""
    console = Console(stderr=True)
    asked = tomllib.loads(TABLE.read_text())[RunFolder.open(arguments.run).config().env]
    goals = [one for i, one in enumerate(asked["goals"]) if not arguments.only or i in arguments.only]
    rows = []
    games = {rival: recorded(arguments, rival, asked["decisions"]) for rival in RIVALS}
    for one in goals:
        rows.append(measured(arguments, one, asked["decisions"], games))
        console.print(asdict(rows[-1]))
    refused = {goal: reason(arguments.run, goal) for goal in asked["impossible"]}
    if arguments.json:
        found = {"rows": [asdict(one) for one in rows], "refused": refused, "decisions": asked["decisions"]}
        print(json.dumps({"run": str(arguments.run), "machine": machine.describe(), **found}))
        return
    table = Table("goal", "goal", "median", *RIVALS, "missed that can be had", box=None, padding=(0, 2, 0, 0))
    for row in rows:
        more = "".join(f", {name} {value}" for name, value in row.conditions.items())
        cells = row.reached, row.median, *row.rivals.values(), f"{sum(row.missed.values())} of {len(row.missed)}"
        table.add_row(row.goal + more, *map(str, cells))
    Console().print(table, refused)


@dataclass
class Game:
    """What was seen in one trial of somebody who does not know the goal."""

    states: list[np.ndarray]
    sizes: list[np.ndarray]

    def meets(self, watch: GoalWatch) -> bool:
        """Tell whether a goal is reached in it."""
        watch.begin()
        reader = watch.words.reader
        for place in range(1, len(self.states)):
            reader.sizes[:] = self.sizes[place]
            watch.observe(self.states[place], self.states[place - 1])
            if watch.progress.reached[0]:
                return True
        return bool(watch.progress.reached_at_end[0])


def recorded(arguments: Arguments, rival: GoalPolicy, decisions: int) -> list[Game]:
    """Play the trials without a goal: the same ones that all goals have."""
    games = []
    with goal_trials(arguments.run, "always(true)", policy=rival) as trials:
        for trial in range(arguments.trials):
            game = Game([], [])

            def note(step: Step, game: Game = game) -> None:
                assert step.state is not None
                game.states.append(step.state.facts)
                game.sizes.append(trials.watch.words.reader.sizes.copy())

            trials.play(trial, decisions, on_step=note)
            games.append(game)
    return games


def measured(arguments: Arguments, asked: dict[str, Any], decisions: int, games: dict[str, list[Game]]) -> Row:
    """Play one goal, and look whether the others met it."""
    conditions = {name: asked[name] for name in CONDITIONS if name in asked}
    with goal_trials(arguments.run, asked["goal"], **conditions) as trials:
        ended = [trials.play(trial, decisions) for trial in range(arguments.trials)]
        rivals = {rival: sum(game.meets(trials.watch) for game in played) for rival, played in games.items()}
        missed = [trial for trial, one in enumerate(ended) if one is None]
        found = {
            trial: goal_oracle.search(trials, trial, most=decisions, courses=arguments.courses) is not None
            for trial in missed
        }
    took = sorted(one for one in ended if one is not None)
    return Row(
        goal=asked["goal"],
        conditions=conditions,
        against=asked.get("against", False),
        reached=len(took),
        median=took[len(took) // 2] if took else None,
        rivals=rivals,
        missed=found,
        trials=arguments.trials,
    )


def reason(run: Path, goal: str) -> str | None:
    """Return why a goal is refused before play; None where it is not."""
    try:
        with goal_trials(run, goal):
            return None
    except UsageError as error:
        return str(error)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
