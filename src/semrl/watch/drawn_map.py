"""A map laid out on a square, as the page draws it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import MapGraph

MOST_NODES, MOST_EDGES = 3_000, 6_000
"""Of a map that are drawn: those that stand for most of what was lived."""


def drawn_map(graph: MapGraph, goals: NDArray[np.bool_]) -> dict[str, Any]:
    """Lay a map out on a square.

    Returns
    -------
    dict
        Of each node drawn its position in the graph (``node``), ``x`` and ``y`` in 0 … 1, its id, states and whether a
        gain begins there; ``edges`` as pairs of places in these lists; ``nodes_in_all``, ``edges_in_all``.
    """
    drawn = np.sort(np.argsort(-graph.node_counts, kind="stable")[:MOST_NODES])
    place = np.full(len(graph), -1)
    place[drawn] = np.arange(len(drawn))
    edges = np.argsort(-graph.edge_counts, kind="stable")
    ends = place[np.column_stack([graph.sources, graph.targets])[edges]]
    ends = ends[(ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1])][:MOST_EDGES]
    places = np.round(_flattened(graph.node_means[drawn]), 4)
    return {
        "node": drawn.tolist(),
        "x": places[:, 0].tolist(),
        "y": places[:, 1].tolist(),
        "id": graph.node_ids[drawn].tolist(),
        "states": graph.node_counts[drawn].tolist(),
        "gain": goals[drawn].tolist(),
        "edges": np.unique(ends, axis=0).tolist(),
        "nodes_in_all": len(graph),
        "edges_in_all": len(graph.edge_ids),
    }


def _flattened(means: NDArray[Any]) -> NDArray[np.float64]:
    """Return places in a unit square, ``(n, 2)``: along the two directions in which the nodes differ most.

    Most nodes lie close together, so that places are drawn half way between where they are and where they would be if
    they lay evenly.
    """
    if not len(means):
        return np.zeros((0, 2))
    centred = means - means.mean(axis=0)
    _, _, directions = np.linalg.svd(centred, full_matrices=False)
    flat = np.zeros((len(means), 2))
    known = directions[:2]
    flat[:, : len(known)] = centred @ known.T
    apart = flat - flat.min(axis=0)
    even = np.argsort(np.argsort(flat, axis=0, kind="stable"), axis=0, kind="stable") / max(len(flat) - 1, 1)
    return np.asarray((apart / np.maximum(apart.max(axis=0), 1e-12) + even) / 2)
