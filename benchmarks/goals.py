"""Goals that a run was never trained for: how often they are reached, beside chance and who was trained for the reward.

python benchmarks/goals.py RUN --json
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import machine
import tyro
from rich.console import Console
from rich.table import Table

from semrl.evaluation.goals import GoalPolicy, play_for_goal

GOALS: tuple[tuple[str, dict[str, object]], ...] = (
    ("own.y <= 33 and ball.x < 50", {}),
    ("own.y > 80", {"hold": 20}),
    ("own.y < 20", {"hold": 20}),
    ("40 < own.y < 60", {"hold": 40}),
    ("ball.x > 75 and own.y < 25", {}),
    ("ball.x > 90 and own.y > 75", {}),
    ("touches(ball, own)", {}),
    ("ball.x < 15", {"avoid": "own.y < 45"}),
    ("in_order(own.y < 20, own.y > 85, own.y < 20)", {}),
    ("own.y > 65", {"until": "ball.x > 75"}),
)
"""Ten: places, some of them held; meetings; ways; the last six may cost a point."""

POLICIES: tuple[GoalPolicy, ...] = ("goal", "random", "agent")


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play ten goals with plans for them, at random, and with the agent as trained."""

    run: tyro.conf.Positional[Path]
    """A trained run of Pong with a map."""
    trials: int = 20
    """Of each goal."""
    decisions: int = 150
    """After which a trial ends."""
    policies: tuple[GoalPolicy, ...] = POLICIES
    """Who plays."""
    first: int = 0
    """Goals that are left out at the beginning."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One goal and who played for it."""

    goal: str
    conditions: dict[str, object]
    policy: str
    reached: int
    trials: int
    median: float | None
    """Decisions of the trials that reached it."""


def main(arguments: Arguments) -> None:
    """Play, and print a table."""
    rows = []
    console = Console(stderr=True)
    for goal, conditions in GOALS[arguments.first :]:
        for policy in arguments.policies:
            rows.append(row(arguments, goal, conditions, policy))
            console.print(asdict(rows[-1]))
    if arguments.json:
        print(
            json.dumps(
                {"run": str(arguments.run), "machine": machine.describe(), "rows": [asdict(one) for one in rows]}
            )
        )
        return
    table = Table("goal", *arguments.policies, box=None, padding=(0, 2, 0, 0))
    for goal, conditions in GOALS[arguments.first :]:
        found = {one.policy: one for one in rows if one.goal == goal}
        more = "".join(f", {name} {value}" for name, value in conditions.items())
        table.add_row(goal + more, *(f"{found[p].reached} of {found[p].trials}" for p in arguments.policies))
    Console().print(table)


def row(arguments: Arguments, goal: str, conditions: dict[str, object], policy: GoalPolicy) -> Row:
    """Play one goal with one policy."""
    result = play_for_goal(
        arguments.run,
        goal,
        trials=arguments.trials,
        max_decisions=arguments.decisions,
        policy=policy,
        **conditions,  # type: ignore[arg-type]
    )
    took = sorted(one for one in result.decisions if one is not None)
    return Row(
        goal=goal,
        conditions=conditions,
        policy=policy,
        reached=result.reached,
        trials=result.trials,
        median=took[len(took) // 2] if took else None,
    )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
