"""``semrl plan``: symbolic plans in discrete worlds, with operators learned from play, carried out and as PDDL."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, show_summary
from semrl.core.errors import UsageError
from semrl.core.files import require_writable, write_text
from semrl.core.strict_json import dumps
from semrl.evaluation.symbolic import (
    LEARNING_DECISIONS,
    PLAY,
    TRIAL_DECISIONS,
    SymbolicPlanner,
    SymbolicWorld,
    learn_world,
    play_plans,
    write_pddl,
)


@dataclass(frozen=True, kw_only=True)
class PlanArguments:
    """Plan with symbols in a world that is drawn cell by cell, seen as pixels alone.

    With --env, it is played first, at random and then so as to try what was never tried, and what the actions do is
    learned from that play, which is kept in the run's folder. Then plans are made and carried out in layouts that were
    not learned from.

    For example
      semrl plan runs/rooms --env MiniGrid-FourRooms-v0 --decisions 600
      semrl plan runs/rooms --trials 20
      semrl plan runs/rooms --goal 3,4 --domain rooms.pddl --problem rooms-1.pddl
    """

    run: tyro.conf.Positional[Path]
    """Folder of the play."""
    env: str | None = None
    """Environment to be played and learned anew, such as MiniGrid-FourRooms-v0."""
    decisions: int = LEARNING_DECISIONS
    """With --env: decisions to learn from."""
    goal: str = "gain"
    """What is sought: gain, end (of the game), row,column, or where something lies: names that the plan command
    tells."""
    trials: int = 1
    """Layouts in which plans are carried out; 0: none."""
    seed: int | None = None
    """Of the first layout, and of learning [default: ones that learning did not use; 0]."""
    most: int = TRIAL_DECISIONS
    """Decisions after which a trial ends."""
    planner: SymbolicPlanner = "astar"
    """Who plans: our own A*, whose plans are shortest, or Fast Downward (extra pddl)."""
    domain: Path | None = None
    """Also write the operators as a PDDL domain."""
    problem: Path | None = None
    """Also write the first layout and the goal as a PDDL problem."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, learn, plan, print."""
    arguments = parse(PlanArguments, argv, command="plan")
    for path in (arguments.domain, arguments.problem):
        if path:
            require_writable(path)
    if arguments.env:
        _learn(arguments, arguments.env)
    solved = 0
    with PlayProgress("plan", max(arguments.trials, 1), "trials") as progress:

        def on_trial(trial: int, decisions: int | None) -> None:
            nonlocal solved
            solved += decisions is not None
            progress.update(trial + 1, 0, lambda: f"{solved} solved")

        result = play_plans(
            arguments.run,
            arguments.goal,
            trials=arguments.trials,
            seed=arguments.seed,
            max_decisions=arguments.most,
            planner=arguments.planner,
            on_trial=on_trial,
        )
    if arguments.domain or arguments.problem:
        domain, problem = write_pddl(arguments.run, arguments.goal, seed=arguments.seed)
        for path, text in ((arguments.domain, domain), (arguments.problem, problem)):
            if path:
                write_text(path, text)
    if arguments.json:
        print(dumps(dataclasses.asdict(result)))
        return
    took = [one for one in result.decisions if one is not None]
    show_summary({
        "world": result.env,
        "operators": f"{result.operators}, from {result.learned_from:,} decisions",
        "things": ", ".join(result.concepts),
        **({"solved": f"{result.solved} of {result.trials} trials"} if result.trials else {}),
        **({"decisions each": f"{min(took):,} … {max(took):,}"} if took else {}),
    })  # fmt: skip


def _learn(arguments: PlanArguments, env: str) -> None:
    if (arguments.run / PLAY).exists() and SymbolicWorld.load(arguments.run).env != env:
        raise UsageError(f"{arguments.run} holds play of another world; choose another folder")
    with PlayProgress("learn", arguments.decisions, "decisions") as progress:
        world = learn_world(
            env,
            decisions=arguments.decisions,
            seed=arguments.seed or 0,
            on_decision=lambda played: progress.update(played, played, lambda: ""),
        )
    world.save(arguments.run)
