"""``semrl play``: play with a trained run for a goal that is given, without training for it."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, show_summary
from semrl.core.strict_json import dumps
from semrl.evaluation.goals import TRIAL_DECISIONS, GoalPolicy, play_for_goal
from semrl.training.loop import Step


@dataclass(frozen=True, kw_only=True)
class PlayArguments:
    """Play for a goal in words of the run's ontology, with the world model and the map that it has learned.

    Places are in percent of the image, from the left and from the top; semrl knowledge RUN lists all words.

    Example:  semrl play runs/first --goal 'own.y <= 33 and ball.x < 50' --trials 20
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    goal: str
    """What is sought: a condition such as 'own.y <= 33', a class expression in Manchester syntax, or always(…),
    eventually(…), before(…, …), in_order(…, …) of conditions."""
    hold: Annotated[int, tyro.conf.arg(name="for")] = 1
    """For how many decisions in a row the goal must hold."""
    until: str | None = None
    """Keep the goal until this condition holds, in place of reaching it."""
    avoid: str | None = None
    """A condition that must never hold meanwhile."""
    trials: int = 1
    """Trials, each from a random start."""
    decisions: int = TRIAL_DECISIONS
    """Decisions after which a trial ends."""
    seed: int | None = None
    """Of the starts [default: that of semrl eval]."""
    policy: GoalPolicy = "goal"
    """Who decides: plans for the goal; or, to compare, chance, or agent and planner as trained for the reward."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, print."""
    arguments = parse(PlayArguments, argv, command="play")
    done = 0
    reached = 0
    with PlayProgress("play", arguments.trials, "trials") as progress:

        def on_step(trial: int, step: Step) -> None:
            nonlocal done
            done += step.action is not None
            progress.update(trial, done, lambda: f"{reached} reached")

        def on_trial(trial: int, decisions: int | None) -> None:
            nonlocal reached
            reached += decisions is not None
            progress.update(trial + 1, done, lambda: f"{reached} reached")

        result = play_for_goal(
            arguments.run,
            arguments.goal,
            hold=arguments.hold,
            until=arguments.until,
            avoid=arguments.avoid,
            trials=arguments.trials,
            max_decisions=arguments.decisions,
            seed=arguments.seed,
            policy=arguments.policy,
            on_trial=on_trial,
            on_step=on_step,
        )
    if arguments.json:
        print(dumps(dataclasses.asdict(result)))
        return
    took = [one for one in result.decisions if one is not None]
    show_summary({
        "goal": result.goal,
        "reached": f"{result.reached} of {result.trials} trials",
        **({"decisions each": f"{min(took):,} … {max(took):,}"} if took else {}),
    })  # fmt: skip
