"""``semrl query``: the map of a run as a knowledge base, asked in SPARQL."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.table import Table
from rich.text import Text

from semrl.cli.arguments import parse
from semrl.cli.progress import console, error_console
from semrl.core.strict_json import dumps
from semrl.evaluation import load_map
from semrl.knowledge.queries import Answer, Limits, ask
from semrl.knowledge.store import to_store


@dataclass(frozen=True, kw_only=True)
class QueryArguments:
    """Ask the state map of a run, and its rules, in SPARQL. Only SELECT and ASK, only this run; nothing is changed or
    fetched.

    Example, the five best transitions:

        semrl query runs/first 'SELECT ?from ?to ?reward { ?t semrl:source ?from; semrl:target ?to;
        semrl:reward ?reward } ORDER BY DESC(?reward) LIMIT 5'

    Classes: semrl:State, semrl:Transition (semrl:PositiveTransition, semrl:NegativeTransition,
    semrl:NeutralTransition), semrl:Action. Properties: semrl:source, semrl:target, semrl:action, semrl:actionShare,
    semrl:reward of a transition; semrl:outgoing, semrl:incoming, semrl:leadsTo of a state; semrl:count, semrl:number of
    both; semrl:about, semrl:condition, semrl:change, semrl:support, semrl:error of a semrl:Rule (models with trees);
    rdfs:label and rdf:type of all. The prefixes semrl, map, rdf, rdfs, owl and xsd are known. All about them:

        semrl query runs/first 'SELECT ?term ?says { ?term rdfs:comment ?says }'
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    query: tyro.conf.Positional[str]
    """In SPARQL."""
    rows: int = Limits().rows
    """Most rows to show."""
    seconds: float = Limits().seconds
    """Longest time to take."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, ask, print."""
    arguments = parse(QueryArguments, argv, command="query")
    limits = Limits(rows=arguments.rows, seconds=arguments.seconds)
    loaded = load_map(arguments.run)
    store = to_store(loaded.graph, loaded.action_names, loaded.rules, base=loaded.base)
    answer = ask(store, arguments.query, limits, base=loaded.base)
    if arguments.json:
        print(dumps({"run": str(arguments.run), **_as_json(answer)}))
        return
    _show(answer)


def _as_json(answer: Answer) -> dict[str, object]:
    if answer.truth is not None:
        return {"truth": answer.truth}
    return {"variables": answer.variables, "rows": answer.rows, "truncated": answer.truncated}


def _show(answer: Answer) -> None:
    if answer.truth is not None:
        console.print("yes" if answer.truth else "no")
        return
    table = Table(*answer.variables, box=None, padding=(0, 2, 0, 0))
    for row in answer.rows:
        table.add_row(*(Text("" if value is None else str(value), overflow="fold") for value in row))
    if answer.rows:
        console.print(table)
    if answer.truncated:
        error_console.print(
            f"These are the first {len(answer.rows):,} rows; there are more: ask for less or raise --rows."
        )
    elif not answer.rows:
        error_console.print("Nothing fits.")
