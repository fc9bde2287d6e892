"""Long-term planning: from every node of the map the cheapest way to the nearest reward (§3.4.2)."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from semrl.core import Ints, MapGraph
from semrl.core.errors import DataError, UsageError


@dataclass(frozen=True, kw_only=True, slots=True)
class LongTermConfig:
    """Parameters of `plan_routes` (§3.4.2)."""

    neutral_cost: float = 1.0
    """Cost of an edge without a reward."""
    positive_cost: float = 1e-9
    """Cost of an edge with a gain: an epsilon for the thesis's 0, as zero weights vanish from sparse graphs."""
    negative_cost: float = 100.0
    """Cost of an edge with a loss."""
    cutoff: float = 100.0
    """Routes that cost more are ignored; one that costs just this much is not."""

    def __post_init__(self) -> None:
        for name in ("neutral_cost", "positive_cost", "negative_cost"):
            if not 0 < getattr(self, name) < math.inf:
                raise UsageError(f"{name} must be a finite number above 0, not {getattr(self, name)}")
        if not self.cutoff >= 0:
            raise UsageError(f"cutoff must be at least 0, not {self.cutoff}")


@dataclass(frozen=True, kw_only=True, slots=True)
class Routes:
    """The cheapest routes from all nodes of a map to their nearest goals (§3.4.2)."""

    distances: NDArray[np.float64]
    """``(n,)`` float64, cost of the route: 0 at goals, inf where none can be reached within the cut-off."""
    next_nodes: Ints
    """``(n,)`` int64, position of the next node on the route; −1 at goals and where no goal can be reached."""
    goals: NDArray[np.bool_]
    """``(n,)`` bool: nodes with an outgoing edge whose reward is positive, or those that were asked for."""

    def __len__(self) -> int:
        return len(self.distances)

    def path(self, node: int) -> Ints:
        """Return the route from a node, ``(k,)`` int64 positions: itself first, the goal last.

        It is empty where no goal can be reached, and a goal's is the goal alone.

        Raises
        ------
        DataError
            There is no such node.
        """
        if not 0 <= node < len(self):
            raise DataError(f"there is no node {node} among {len(self)}")
        if self.distances[node] == math.inf:
            return np.zeros(0, np.int64)
        nodes = [int(node)]
        while (following := int(self.next_nodes[nodes[-1]])) >= 0:
            nodes.append(following)
        return np.array(nodes, np.int64)


def plan_routes(graph: MapGraph, config: LongTermConfig, *, goals: NDArray[np.bool_] | None = None) -> Routes:
    """Find the cheapest route from each node to a node with a positive outgoing edge (§3.4.2), or to other goals.

    One pass of Dijkstra's algorithm from all goals at once, against the direction of the edges. Of parallel edges
    the cheapest counts. Equal maps have equal routes, whatever the order of their edges.

    Notes
    -----
    A positive edge starts at a goal, where routes end, so none is ever part of a route.
    """
    n = len(graph)
    if goals is None:
        goals = np.zeros(n, np.bool_)
        goals[graph.sources[graph.reward_signs > 0]] = True
    if not goals.any():
        return Routes(distances=np.full(n, np.inf), next_nodes=np.full(n, -1, np.int64), goals=goals)
    distances, towards, _ = dijkstra(
        _reversed(graph, edge_costs(graph, config)),
        indices=np.flatnonzero(goals),
        min_only=True,
        return_predecessors=True,
        limit=config.cutoff,
    )
    return Routes(distances=distances, next_nodes=np.maximum(towards, -1).astype(np.int64), goals=goals)


def edge_costs(graph: MapGraph, config: LongTermConfig) -> NDArray[np.float64]:
    """Return what each edge costs, ``(m,)``, which follows from the kind of its reward (§3.4.2)."""
    costs: NDArray[np.float64] = np.array([config.negative_cost, config.neutral_cost, config.positive_cost])
    return costs[graph.reward_signs + 1]


def edges_along(graph: MapGraph, path: Ints, config: LongTermConfig) -> Ints:
    """Find the edges that a path of `Routes` follows, and the rewarding edge at its end, where one begins there.

    Parameters
    ----------
    graph, config
        The map and the costs that the routes were planned with.
    path
        ``(k,)`` positions of nodes; it may be empty.

    Returns
    -------
    ndarray
        ``(k,)`` int64 positions of edges, or ``(k - 1,)`` where no reward is to be had at its end. Of parallel edges
        the cheapest is followed, of equally cheap ones the one that stands for the most transitions.
    """
    order = np.lexsort((-graph.edge_counts, edge_costs(graph, config)))
    sources, targets, gains = graph.sources[order], graph.targets[order], graph.reward_signs[order] > 0
    followed = [(sources == a) & (targets == b) for a, b in pairwise(path.tolist())]
    followed += [gaining for end in path[-1:].tolist() if (gaining := (sources == end) & gains).any()]
    return np.array([order[fits.argmax()] for fits in followed], np.int64)


def _reversed(graph: MapGraph, costs: NDArray[np.float64]) -> csr_array:
    """Return the graph with every edge turned round, ``(n, n)``; scipy would add up parallel edges."""
    n = len(graph)
    pairs, places = np.unique(graph.targets * n + graph.sources, return_inverse=True)
    least = np.full(len(pairs), np.inf)
    np.minimum.at(least, places, costs)
    return csr_array((least, (pairs // n, pairs % n)), shape=(n, n))
