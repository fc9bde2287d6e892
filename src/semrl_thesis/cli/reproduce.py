"""``semrl reproduce``: the tests, tables and figures of thesis chapter 4, ours beside the thesis's."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro
from rich.table import Table

from semrl.cli.arguments import parse
from semrl.cli.progress import console, say
from semrl.core.errors import SemrlError
from semrl.core.strict_json import dumps
from semrl.report.wording import number
from semrl_thesis.base import Scale
from semrl_thesis.report.reproduction import write_reproduction
from semrl_thesis.reproduction import Order, reproduce
from semrl_thesis.results import Row


@dataclass(frozen=True, kw_only=True)
class ReproduceArguments:
    """Do the thesis's evaluation again, ours beside the thesis's: method, clusters, retrieval, ontology, scores.

    And what goes beyond it: embedding and drift, which embedding is best; frontier, how far 100,000 decisions lead;
    games, the same on ten Atari games.

    Results, runs and one page, report.html, go into a folder. What is there already is not done again, so that it can
    be stopped at any moment: the same command goes on. At full scale the results that come with this package count
    as well, unless they are to be measured --afresh.

    Example:  semrl reproduce clusters retrieval
    """

    names: tyro.conf.Positional[tuple[str, ...]] = ()
    """Which of them [default: all]."""
    scale: Scale = "quick"
    """'full' is the thesis's budget, many hours; 'quick' takes minutes, 'tiny' seconds, and tells how it works."""
    out: Path | None = None
    """Folder of results, runs and the page [default: runs/reproduce-SCALE]."""
    workers: Literal[0, 1, 2] = 2
    """Training runs side by side; 0: none of ours are trained."""
    order: Literal["cheapest", "listed"] = "cheapest"
    """Which runs come first."""
    only: tuple[str, ...] = ()
    """Train only runs that match one of these patterns, such as 'semrl-ram*' for PRESET-MODEL-SEED."""
    afresh: bool = False
    """Measure and train again what this package comes with results of."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, measure, write the page, tell."""
    arguments = parse(ReproduceArguments, argv, command="reproduce")
    out = arguments.out or Path("runs") / f"reproduce-{arguments.scale}"
    order = Order(workers=arguments.workers, order=arguments.order, only=arguments.only, afresh=arguments.afresh)
    done = reproduce(arguments.names, scale=arguments.scale, out=out, order=order, say=say)
    page = write_reproduction(done.sections, out / "report.html", scale=arguments.scale)
    if done.failures:
        name, said = next(iter(done.failures.items()))
        raise SemrlError(f"{len(done.failures)} runs failed, the first of them {name}: {said}; the rest is in {page}")
    if arguments.json:
        print(dumps({"page": str(page), "results": [dataclasses.asdict(row) for row in done.rows]}))
        return
    console.print(_table(done.rows))
    console.print(f"page: {page.resolve().as_uri()}", soft_wrap=True)


def _table(rows: Sequence[Row]) -> Table:
    """Lay the rows out."""
    table = Table("number", "ours", "thesis", "", box=None, padding=(0, 2, 0, 0))
    for row in rows:
        cells = ("–" if value is None else number(value, 3) for value in (row.ours, row.thesis))
        table.add_row(row.id, *cells, row.unit)
    return table
