"""``semrl predict``: how far a run's model of the world sees ahead."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, show_summary
from semrl.core.strict_json import dumps
from semrl.evaluation.player import Policy
from semrl.evaluation.prediction import Quality, world_model_accuracy


@dataclass(frozen=True, kw_only=True)
class PredictArguments:
    """Play new episodes and compare what came with what the model predicted; write predictions.json beside the run.

    It prints which share of the variance of the states was predicted 1 to 20 decisions ahead, and how many gains and
    losses one ahead. Nothing is learned from these episodes; one action in a hundred is random.

    Example:  semrl predict runs/first && semrl report runs/first
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run (models with a map)."""
    decisions: int = 10_000
    """So many are played; the episode that they end in is left."""
    seed: int | None = None
    """Of the episodes [default: one that training did not use]."""
    policy: Policy = "agent"
    """Who plays."""
    at: int | None = None
    """Test the model as it was after so many decisions: one of the run's milestones [default: as it is now]."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, compare, print."""
    arguments = parse(PredictArguments, argv, command="predict")
    with PlayProgress("predict", arguments.decisions, "decisions") as progress:
        quality = world_model_accuracy(
            arguments.run,
            decisions=arguments.decisions,
            seed=arguments.seed,
            policy=arguments.policy,
            at=arguments.at,
            on_step=progress.count,
        )
    if arguments.json:
        print(dumps({"run": str(arguments.run), **dataclasses.asdict(quality)}))
        return
    show_summary(_as_rows(quality))


def _as_rows(quality: Quality) -> dict[str, object]:
    rows: dict[str, object] = {
        f"{horizon} ahead": f"{share:.1%} of the variance" for horizon, share in quality.explained.items()
    }
    for sign, name in ((0, "losses"), (2, "gains")):
        came = sum(quality.confusion[sign])
        rows[f"{name} predicted"] = f"{quality.confusion[sign][sign]:,} of {came:,}"
    return rows | {"decisions": f"{quality.decisions:,}"}
