"""Maps to test with."""

import numpy as np

from semrl.core import MapGraph

ACTIONS = ("NOOP", "FIRE", "UP RIGHT")


def random_map(seed, n_nodes=9, n_edges=25, dimension=5):
    """Make a map with loops and parallel edges, whose ids are not positions."""
    rng = np.random.default_rng(seed)
    shares = rng.random((n_edges, len(ACTIONS)))
    return MapGraph(
        node_ids=np.arange(n_nodes) * 3,
        node_means=rng.normal(size=(n_nodes, dimension)),
        node_counts=rng.integers(1, 50, n_nodes),
        edge_ids=np.arange(n_edges) * 2 + 1,
        sources=rng.integers(0, max(n_nodes, 1), n_edges),
        targets=rng.integers(0, max(n_nodes, 1), n_edges),
        edge_counts=rng.integers(1, 9, n_edges),
        rewards=rng.choice([-1.0, -0.3, 0.0, 0.75], n_edges),
        actions=shares / shares.sum(axis=1, keepdims=True),
    )


def empty_map():
    return random_map(0, 0, 0)
