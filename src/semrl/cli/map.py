"""``semrl map``: what the map of a run looks like, and the map as a file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console, show_summary
from semrl.core import MapGraph
from semrl.core.files import require_writable, write_atomic
from semrl.core.strict_json import dumps
from semrl.evaluation.graph import load_graph
from semrl.knowledge.description import MapDescription, describe


@dataclass(frozen=True, kw_only=True)
class MapArguments:
    """Describe the state map of a run: nodes, edges, how many lead to gains and losses, how far it is across.

    Diameter and radius are counted in steps along the edges, within the largest part of the map in which every node
    can be reached from every other.

    Example:  semrl map runs/first --export map.gexf
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    export: Path | None = None
    """Also write the map: .graphml or .gexf for graph tools such as Gephi, .ttl for RDF tools, with its rules."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, describe, write, print."""
    arguments = parse(MapArguments, argv, command="map")
    if arguments.export:
        _check(arguments.export)  # what cannot be written is refused before a large run is loaded
    described = describe(_export(arguments.run, arguments.export) if arguments.export else load_graph(arguments.run))
    if arguments.json:
        print(dumps(_as_json(arguments, described)))
        return
    show_summary(_as_rows(described))
    if arguments.export:
        console.print(f"written: {arguments.export}", soft_wrap=True, markup=False, highlight=False)


def _check(path: Path) -> None:
    from semrl.knowledge.export import exporter

    exporter(path)
    require_writable(path)


def _export(run: Path, path: Path) -> MapGraph:
    """Write the map; return it."""
    from semrl.evaluation.maps import (
        load_map,
    )  # late: names of actions and rules need the game and the agent, and take long
    from semrl.knowledge.export import exporter

    loaded = load_map(run)
    written = exporter(path)(loaded.graph, loaded.action_names, loaded.rules, base=loaded.base)
    write_atomic(path, lambda file: file.write(written))
    return loaded.graph


def _as_json(arguments: MapArguments, described: MapDescription) -> dict[str, object]:
    return {
        "run": str(arguments.run),
        "nodes": described.nodes,
        "edges": described.edges,
        "positive": described.positive_share,
        "negative": described.negative_share,
        "diameter": described.diameter,
        "radius": described.radius,
        "component_nodes": described.component_nodes,
        "states": described.states,
        "transitions": described.transitions,
        "export": None if arguments.export is None else str(arguments.export),
    }


def _as_rows(described: MapDescription) -> dict[str, object]:
    return {
        "nodes": f"{described.nodes:,}, for {described.states:,} states",
        "edges": f"{described.edges:,}, for {described.transitions:,} transitions",
        "edges with a gain": f"{described.positive_share:.1%}",
        "edges with a loss": f"{described.negative_share:.1%}",
        "connected both ways": f"{described.component_nodes:,} nodes, where",
        "diameter, radius": f"{described.diameter} and {described.radius} steps",
    }
