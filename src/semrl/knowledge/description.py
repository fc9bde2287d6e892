"""The state map in a few numbers, as the thesis describes its own (§4.2, "Graph description")."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from semrl.core import MapGraph


@dataclass(frozen=True, kw_only=True, slots=True)
class MapDescription:
    """What §4.2 says of a state map.

    Diameter and radius are the largest and the smallest eccentricity; the eccentricity of a node is the number of steps
    to the node that is farthest from it. Steps follow the direction of the edges: the thesis's graph is directed
    (§3.4.1), and its diameter of 20 with a radius of 9 is possible in directed graphs only. Where one node cannot be
    reached from another there are no such numbers, so they are those of the largest strongly connected component.
    """

    nodes: int
    edges: int
    """Centroids of the two trees."""
    states: int
    transitions: int
    """What the nodes and the edges stand for."""
    positive_share: float
    negative_share: float
    """Share of the edges whose reward is of that sign, 0 … 1; 0 without edges."""
    component_nodes: int
    """Nodes of the largest strongly connected component; among equals, of the one with the earliest node."""
    diameter: int | None
    radius: int | None
    """Of that component, in steps; None for a map without nodes."""


def describe(graph: MapGraph) -> MapDescription:
    """Describe a map (§4.2).

    One breadth-first search a node of the component, so the time grows with nodes × edges; memory with their sum.
    """
    signs = graph.reward_signs
    farthest = _eccentricities(_largest_component(graph)) if len(graph) else []
    return MapDescription(
        nodes=len(graph),
        edges=len(signs),
        states=int(graph.node_counts.sum()),
        transitions=int(graph.edge_counts.sum()),
        positive_share=float(np.mean(signs == 1)) if len(signs) else 0.0,
        negative_share=float(np.mean(signs == -1)) if len(signs) else 0.0,
        component_nodes=len(farthest),
        diameter=max(farthest, default=None),
        radius=min(farthest, default=None),
    )


def _largest_component(graph: MapGraph) -> csr_array:
    """Return which nodes of the largest strongly connected component are one step apart, ``(k, k)``."""
    apart = graph.sources != graph.targets
    ends = (graph.sources[apart], graph.targets[apart])
    steps = csr_array((np.ones(len(ends[0])), ends), shape=(len(graph), len(graph)))
    _, labels = connected_components(steps, connection="strong")
    sizes = np.bincount(labels)[labels]
    members = np.flatnonzero(labels == labels[sizes.argmax()])
    return steps[members][:, members]


def _eccentricities(steps: csr_array) -> list[int]:
    """Return each node's number of steps to the node farthest from it: the last one that a search from it finds."""
    farthest = []
    for start in range(steps.shape[0]):
        order, parents = breadth_first_order(steps, start)
        node, n_steps = order[-1], 0
        while node != start:
            node, n_steps = parents[node], n_steps + 1
        farthest.append(n_steps)
    return farthest
