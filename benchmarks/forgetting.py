"""What the forests of a world model (§3.4.3) forgot: which losses and gains of a run's memory each of them predicts.

Each forest was grown at another time, from what was remembered then. Of the memory as it is now the part that came
later is new to it. Where much was won before, a forest may have learned from few losses. One decision ahead;
where a run remembers more than trees are shown at once, an even draw of it.

    python benchmarks/forgetting.py RUN [--spans N] [--json]
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from trees import remembered

from semrl.training.session import limited_threads


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Tell which losses and gains of a run's memory its forests predict, by when these were grown."""

    run: Annotated[Path, tyro.conf.Positional]
    """A run of a model whose world is predicted by trees: ram-map, objects-map, semantic-map."""
    spans: int = 8
    """How many parts of the memory are told apart."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Ask every forest about every part of the memory and tell."""
    with limited_threads(1):
        spans = asked(arguments.run, arguments.spans)
    if arguments.json:
        print(json.dumps({"machine": machine.describe(), "run": str(arguments.run), "spans": spans}))
        return
    grown = [f"{n / 1000:.0f}" for n in spans[0]["predicted"]]
    table = Table("decisions", "losses", *grown, box=None, padding=(0, 2, 0, 0))
    for span in spans:
        shares = ("" if losses is None else f"{losses:.2f}" for losses, _ in span["predicted"].values())
        table.add_row(f"{span['from'] / 1000:.0f}–{span['to'] / 1000:.0f}", str(span["losses"]), *shares)
    console = Console()
    console.print("Thousands of decisions; share of the losses that the forests grown then predict.", highlight=False)
    console.print(table)


def asked(run: Path, count: int) -> list[dict[str, Any]]:
    """Return what each forest predicts of each part of the memory, the oldest first."""
    world, rows, targets = remembered(run)
    told, came = np.rint(world.forests(rows)[:, :, -2]), targets[:, -2]
    grown = {int(n): world.grown_ == n for n in np.unique(world.grown_)}
    places = np.linspace(0, len(rows), count + 1).astype(int)
    oldest, newest = world.seen_ - len(world.experience), world.seen_
    times = np.linspace(oldest, newest, count + 1).astype(int).tolist()
    return [
        {
            "from": times[i],
            "to": times[i + 1],
            "losses": int((came[part] == -1).sum()),
            "gains": int((came[part] == 1).sum()),
            "predicted": {
                n: [_share(told[forests, part], came[part], sign) for sign in (-1, 1)] for n, forests in grown.items()
            },
        }
        for i, part in enumerate(map(slice, places[:-1], places[1:]))
    ]


def _share(told: NDArray[np.float64], came: NDArray[np.float64], sign: int) -> float | None:
    """Return the share of the rewards of a sign, of ``(n,)`` that came, that some forests told, ``(f, n)``."""
    meant = came == sign
    return float((told[:, meant] == sign).mean()) if meant.any() else None


if __name__ == "__main__":
    main(tyro.cli(Arguments))
