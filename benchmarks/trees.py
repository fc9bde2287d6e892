"""How long the trees of a world model take to grow (§3.4.3), from what a run remembers, beside scikit-learn's.

Of the first so many decisions a run of a map model remembers, one forest is grown: a tree for the change of each
number that varies, for the reward, and for the return expected beyond a scenario, each from as many rows drawn with
repetitions. scikit-learn's `DecisionTreeRegressor` then grows the same trees from the same draw; it sorts where ours
counts, and breaks ties otherwise. Processor time, compiled code compiled before. One process, one thread.

    python benchmarks/trees.py RUN [--decisions N ...] [--json]
"""

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from sklearn.tree import DecisionTreeRegressor

from semrl.core import Floats
from semrl.core.errors import UsageError
from semrl.evaluation.player import load_player
from semrl.training.session import limited_threads
from semrl.world_model import TreeWorld
from semrl.world_model.cart import bins_of, grow_tree

COLUMNS = ("decisions", "seen", "trees", "leaves", "bins, s", "semrl, s", "sklearn, s", "its leaves", "ratio")
"""Of the table: numbers seen of a decision, leaves of all trees; ratio of the times, bins included."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Measure how long a forest takes to grow from what a run remembers."""

    run: Annotated[Path, tyro.conf.Positional]
    """A run of a model whose world is predicted by trees: ram-map, objects-map, semantic-map."""
    decisions: tuple[int, ...] = (1_000, 10_000, 100_000)
    """How many of those it remembers."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Measure every size and tell."""
    with limited_threads(1):
        world, rows, targets = remembered(arguments.run)
        measure(world, rows[:200], targets[:200])
        sizes = sorted({min(n, len(rows)) for n in arguments.decisions})
        told = [measure(world, rows[:n], targets[:n]) for n in sizes]
        kind = machine.describe()
    if arguments.json:
        print(json.dumps({"machine": kind, "run": str(arguments.run), "forests": told}))
        return
    table = Table(*COLUMNS, box=None, padding=(0, 2, 0, 0))
    for row in told:
        table.add_row(*(f"{row[name]:,}" if isinstance(row[name], int) else f"{row[name]:.3g}" for name in COLUMNS))
    console = Console()
    console.print(table)
    console.print(machine.sentence(kind), highlight=False)


def remembered(run: Path) -> tuple[TreeWorld, Floats, NDArray[np.float64]]:
    """Return the world model of a run, and what its trees learn from."""
    world = load_player(run, memory=True).require_predictions(run).world_model
    if not isinstance(world, TreeWorld):
        raise UsageError(f"{run} remembers nothing that trees learn from")
    return world, *world.features.training_set(world.experience, np.random.default_rng(0))


def measure(world: TreeWorld, rows: Floats, targets: NDArray[np.float64]) -> dict[str, Any]:
    """Grow one forest by both."""
    drawn = np.random.default_rng(0).integers(len(rows), size=len(rows))
    leaf_rows = world.config.leaf_rows(targets.shape[1])
    begun = time.process_time()
    places, cuts = bins_of(rows)
    binned = time.process_time()
    trees = [grow_tree(places, cuts, column.copy(), drawn, n) for column, n in zip(targets.T, leaf_rows, strict=True)]
    grown = time.process_time()
    theirs = [
        DecisionTreeRegressor(min_samples_leaf=n, random_state=0).fit(rows[drawn], column[drawn])
        for column, n in zip(targets.T, leaf_rows, strict=True)
    ]
    there = time.process_time() - grown
    leaves = int(sum((nodes[:, 0] < 0).sum() for nodes, _, _ in trees))
    both = len(rows), rows.shape[1], len(trees), leaves, binned - begun, grown - binned, there
    return dict(
        zip(COLUMNS, (*both, int(sum(tree.get_n_leaves() for tree in theirs)), there / (grown - begun)), strict=True)
    )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
