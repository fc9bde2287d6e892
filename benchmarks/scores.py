"""Train and test models on several seeds, one after the other, and print every seed's score.

What is done is not done again, and what was interrupted goes on: call it as often as you like, for several
models side by side if there are processors.

    python benchmarks/scores.py --models ram semantic --seeds 0 1 2
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import machine
import tyro
from rich.console import Console
from rich.table import Table

from semrl import evaluate, preset, train
from semrl.evaluation.prediction import FILE, world_model_accuracy
from semrl.training import RunFolder
from semrl.training.config import MODELS


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Train and test models on several seeds."""

    models: tuple[str, ...] = ("ram", "semantic")
    """Models of Table 4.1."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Seeds of the runs."""
    planner_episodes: int = 10
    """Evaluation episodes that the planner plays alone, for models with a map."""
    preset: str = "semrl"
    """Named settings."""
    decisions: int = 100_000
    """Budget of each run, perception included."""
    out: Path = Path("runs/scores")
    """Folder of the runs."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(arguments: Arguments) -> None:
    """Run what is missing and print the table."""
    rows = [score(arguments, model, seed) for model in arguments.models for seed in arguments.seeds]
    if arguments.json:
        print(json.dumps({"machine": machine.describe(), "scores": rows}))
        return
    Console().print(table(rows))


def score(arguments: Arguments, model: str, seed: int) -> dict[str, Any]:
    """Train and test one run as far as that was not done yet."""
    run = arguments.out / f"{model}-{seed}"
    config = preset(arguments.preset, model, {"decisions": arguments.decisions, "seed": seed})
    result = train(run) if run.exists() else train(run, config)
    tested = kept(run / "evaluation.json", lambda: evaluate(run))
    return {
        "model": model,
        "seed": seed,
        "decisions": result.decisions,
        "episodes": result.episodes,
        "last10": result.return_mean_last10,
        **{key: tested[key] for key in ("mean", "std", "min", "max")},
        "minutes": round(result.seconds / 60, 1),
        "weights": RunFolder.open(run).manifest()["hashes"]["weights"][:8],
        **(planned(arguments, run) if MODELS[model].plans else {}),
    }


def planned(arguments: Arguments, run: Path) -> dict[str, Any]:
    """Test what a run predicts, and its planner alone."""
    seen = kept(run / FILE, lambda: world_model_accuracy(run))
    played = kept(
        run / "evaluation-planner.json",
        lambda: evaluate(run, episodes=arguments.planner_episodes, policy="planner"),
    )
    explained = {f"R2 at {horizon}": value for horizon, value in seen["explained"].items()}
    explained |= {f"vector R2 at {horizon}": value for horizon, value in seen["explained_vectors"].items()}
    alone = {f"planner {key}": played[key] for key in ("mean", "min", "max")}
    return {**explained, "balanced": seen["balanced_accuracy"], **alone}


def kept(file: Path, make: Callable[[], object]) -> dict[str, Any]:
    """Return what a file holds, which is made first where there is none."""
    if not file.exists():
        make()
    told: dict[str, Any] = json.loads(file.read_text())
    return told


def table(rows: Sequence[dict[str, Any]]) -> Table:
    """Lay the rows out."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    laid = Table(*columns, box=None, padding=(0, 2, 0, 0))
    for row in rows:
        laid.add_row(
            *(f"{row[key]:.2f}" if isinstance(row.get(key), float) else str(row.get(key, "")) for key in columns)
        )
    return laid


if __name__ == "__main__":
    main(tyro.cli(Arguments))
