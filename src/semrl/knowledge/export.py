"""The state map as a file for other programs: GraphML and GEXF for graph tools, Turtle for RDF tools (§3.4.1)."""

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import networkx as nx  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from semrl.core import MapGraph
from semrl.core.errors import UsageError
from semrl.knowledge.store import most_frequent_actions, to_store, to_turtle
from semrl.knowledge.vocabulary import INSTANCES
from semrl.world_model.rules import Rule


class Exporter(Protocol):
    """Writes a map, given the names of its actions, the learned rules, and what the names of its instances begin with.

    The same map always gives the same bytes.
    """

    def __call__(
        self, graph: MapGraph, action_names: Sequence[str], rules: Sequence[Rule] = (), *, base: str = INSTANCES
    ) -> bytes:
        """Return the content of a file."""
        ...


_COLOURS = ({"r": 214, "g": 180, "b": 0}, {"r": 0, "g": 150, "b": 60}, {"r": 200, "g": 30, "b": 30})
"""Of neutral, positive and negative edges (0, 1, -1), as in Figure 4.15."""


def graphml(
    graph: MapGraph, action_names: Sequence[str], rules: Sequence[Rule] = (), *, base: str = INSTANCES
) -> bytes:
    """Write a map as GraphML, each edge with its count, reward, sign and the share of each action; no rules."""
    del rules, base
    file = io.BytesIO()
    nx.write_graphml_xml(_network(graph, action_names), file)
    return file.getvalue()


def gexf(graph: MapGraph, action_names: Sequence[str], rules: Sequence[Rule] = (), *, base: str = INSTANCES) -> bytes:
    """Write a map as GEXF for Gephi: as `graphml`, with the places and colours of Figure 4.15."""
    del rules, base
    network = _network(graph, action_names)
    for _, node in network.nodes(data=True):
        node["viz"] = {"position": {"x": node["x"], "y": node["y"], "z": 0.0}}
    for _, _, number, edge in network.edges(keys=True, data=True):
        edge.update({"id": number, "viz": {"color": _COLOURS[edge["sign"]]}})
    file = io.BytesIO()
    nx.write_gexf(network, file)
    return re.sub(rb' lastmodifieddate="[^"]*"', b"", file.getvalue(), count=1)  # the date would make every file differ


def turtle(graph: MapGraph, action_names: Sequence[str], rules: Sequence[Rule] = (), *, base: str = INSTANCES) -> bytes:
    """Write a map as Turtle: the ontology, then states, transitions, actions and rules."""
    return to_turtle(to_store(graph, action_names, rules, base=base), base=base)


EXPORTERS: dict[str, Exporter] = {".graphml": graphml, ".gexf": gexf, ".ttl": turtle}
"""Suffix of a file → what writes it."""


def exporter(path: Path) -> Exporter:
    """Return what writes files of this suffix.

    Raises
    ------
    UsageError
        When nothing does.
    """
    if path.suffix.lower() not in EXPORTERS:
        raise UsageError(f"a map is exported as {', '.join(EXPORTERS)}, not as {path.suffix or path.name}")
    return EXPORTERS[path.suffix.lower()]


def _network(graph: MapGraph, action_names: Sequence[str]) -> nx.MultiDiGraph:
    network = nx.MultiDiGraph()
    ids = graph.node_ids.tolist()
    for number, count, (x, y) in zip(ids, graph.node_counts.tolist(), _places(graph.node_means), strict=True):
        network.add_node(number, label=f"state {number}", count=count, x=x, y=y)
    actions = most_frequent_actions(graph, action_names)
    signs = graph.reward_signs
    for i, number in enumerate(graph.edge_ids.tolist()):
        network.add_edge(
            ids[graph.sources[i]],
            ids[graph.targets[i]],
            key=number,
            count=int(graph.edge_counts[i]),
            reward=float(graph.rewards[i]),
            sign=int(signs[i]),
            action=action_names[actions[i]],
            **{f"share of {name}": share for name, share in zip(action_names, graph.actions[i].tolist(), strict=True)},
        )
    return network


def _places(means: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return the first two principal components of the nodes, as Figure 4.15 places them; their signs are fixed."""
    if not means.size:
        return [(0.0, 0.0)] * len(means)
    centred = means - means.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2][:2]
    axes = axes * np.sign(axes[np.arange(len(axes)), np.abs(axes).argmax(axis=1)])[:, None]
    places = np.zeros((len(means), 2))
    places[:, : len(axes)] = centred @ axes.T
    return [(x, y) for x, y in places.tolist()]
