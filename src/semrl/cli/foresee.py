"""``semrl foresee``: how far a run's model of the world sees ahead."""

import contextlib
import dataclasses
import json as json_format
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console, progress_bars, summary
from semrl.evaluation.player import Policy
from semrl.evaluation.prediction import Quality, foresight
from semrl.training.loop import Step


@dataclass(frozen=True, kw_only=True)
class ForeseeArguments:
    """Play new episodes and compare what came with what the model foresaw; write foresight.json beside the run.

    It tells which share of the variance of the states was foreseen 1 to 20 decisions ahead, and how many gains and
    losses one ahead. Nothing is learned from these episodes; one action in a hundred is random.

    Example:  semrl foresee runs/first && semrl report runs/first
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run (models with a map)."""
    decisions: int = 10_000
    """At least so many are played, whole episodes."""
    seed: int | None = None
    """Of the episodes [default: one that training did not use]."""
    policy: Policy = "agent"
    """Who plays."""
    at: int | None = None
    """Test the model as it was after so many decisions: one of the run's milestones [default: as it is now]."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, compare, tell."""
    arguments = parse(ForeseeArguments, argv, command="foresee")
    bars = progress_bars()
    with contextlib.ExitStack() as stack:

        def on_step(_step: Step) -> None:
            if not bars.tasks:  # nothing is shown before: a call that cannot work costs one line, the error's
                stack.enter_context(bars)
                bars.add_task("foresee", total=arguments.decisions, note="")
            bars.update(bars.task_ids[0], advance=1)

        quality = foresight(
            arguments.run,
            decisions=arguments.decisions,
            seed=arguments.seed,
            policy=arguments.policy,
            at=arguments.at,
            on_step=on_step,
        )
    if arguments.json:
        print(json_format.dumps({"run": str(arguments.run), **dataclasses.asdict(quality)}))
        return
    console.print(summary(_as_rows(quality)))


def _as_rows(quality: Quality) -> dict[str, object]:
    rows: dict[str, object] = {
        f"{horizon} ahead": f"{share:.1%} of the variance" for horizon, share in quality.explained.items()
    }
    for sign, name in ((0, "losses"), (2, "gains")):
        came = sum(quality.confusion[sign])
        rows[f"{name} foreseen"] = f"{quality.confusion[sign][sign]:,} of {came:,}"
    return rows | {"decisions": f"{quality.decisions:,}"}
