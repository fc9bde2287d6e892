"""The state map: a graph whose nodes are clusters of states and whose edges are clusters of transitions (§3.4.1)."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints, MapGraph, Trajectory
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering.cf_kernels import LARGEST
from semrl.perception.clustering.cf_tree import CFTree, CFTreeConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class StateMapConfig:
    """Parameters of `StateMap` (§3.4.1)."""

    node_threshold: float = 0.011
    """Largest radius of a node, in units of the state, for each number of a state and its change (D38)."""
    edge_threshold: float = 0.015
    """Largest radius of an edge, likewise for each number of a state and its change."""
    branching_factor: int = 100
    """Most children of a node of either tree."""
    max_nodes: int = 0
    """Most nodes of the map; beyond it the threshold grows. 0: no limit, as in the thesis."""
    max_edges: int = 0
    """Most edges of the map; beyond it the threshold grows. 0: no limit, as in the thesis."""
    reward_weight: float = 1.0
    """What a reward of 1 weighs in a transition, in units of the state. The larger it is, the more neutral transitions
    an edge must have before it takes in a gain or a loss (D40)."""
    compact: bool = False
    """Whether a state or transition must also lie within the threshold of the mean of the cluster it joins."""

    def __post_init__(self) -> None:
        for name in ("node_threshold", "edge_threshold"):
            if not 0 <= getattr(self, name) <= LARGEST:
                raise UsageError(f"{name} must be a finite number of at least 0, not {getattr(self, name)}")
        for name in ("max_nodes", "max_edges"):
            if getattr(self, name) < 0:
                raise UsageError(f"{name} must be at least 0 (no limit), not {getattr(self, name)}")
        if not 0 < self.reward_weight <= LARGEST:
            raise UsageError(f"reward_weight must be a finite number above 0, not {self.reward_weight}")
        self.nodes(1)  # checks the branching factor

    def nodes(self, dimension: int) -> CFTreeConfig:
        """Return the node tree's part, where a state and its change have `dimension` numbers."""
        return self._tree(self.node_threshold * dimension, self.max_nodes)

    def edges(self, dimension: int) -> CFTreeConfig:
        """Return the edge tree's part, where a state and its change have `dimension` numbers."""
        return self._tree(self.edge_threshold * dimension, self.max_edges)

    def _tree(self, threshold: float, most: int) -> CFTreeConfig:
        return CFTreeConfig(
            threshold=threshold,
            branching_factor=self.branching_factor,
            compact=self.compact,
            max_leaves=most or None,
        )


class StateMap:
    """What was seen of the world's dynamics, as a graph learned episode by episode (§3.4.1).

    One `CFTree` clusters states, another one transitions, written as rows ``(start, end, one-hot action,
    reward × reward_weight)``. A leaf's mean is the mean of all its rows, so the mean reward and the shares of the
    actions of an edge stand in its centroid. An edge joins the nodes that a descent of the node tree finds for
    its mean start and its mean end. Ids of nodes and edges are those of the leaves: they stay as the map grows,
    and where a limit makes two leaves one, the older id lives on.

    Parameters
    ----------
    config
        See `StateMapConfig`.
    dimension
        Numbers in a state, at least 1.
    n_actions
        How many actions there are, at least 1.
    changes
        Whether a state's numbers hold its change already; else the thresholds count as many numbers again for it.

    Notes
    -----
    A descent may miss the nearest node, so a state seen twice can be in two nodes, of which only one is found
    later; `locate` and the ends of edges descend alike and so agree. An episode cut in two counts the state at the
    cut twice, which is all that the cut changes for the rows that the trees see.
    """

    def __init__(self, config: StateMapConfig, dimension: int, n_actions: int, *, changes: bool = False) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        self.changes = changes
        counted = dimension if changes else 2 * dimension
        self._nodes = CFTree(self.config.nodes(counted))
        self._edges = CFTree(self.config.edges(counted))
        self._graph = self._read_graph()

    @property
    def graph_(self) -> MapGraph:
        """The map after the last episode: a snapshot, its arrays read-only; it has no nodes before the first."""
        return self._graph

    def partial_fit(self, trajectory: Trajectory) -> Self:
        """Learn one episode and read the graph anew; a trajectory without decisions adds its one state.

        Raises
        ------
        DataError
            Shapes do not fit each other, the dimension or the number of actions, or a number is not finite;
            nothing is learned then.
        """
        self._insert(trajectory)
        self._graph = self._read_graph()
        return self

    def locate(self, states: NDArray[Any]) -> Ints:
        """Return the node of each of ``(b, d)`` states, ``(b,)`` int64, as positions in `graph_`; learns nothing.

        Raises
        ------
        DataError
            The map is empty, or states are not finite or not of the right dimension.
        """
        if not len(self._graph):
            raise DataError("the map is empty: call partial_fit first")
        return self._positions(states, self._graph.node_ids)

    def locate_transitions(self, trajectory: Trajectory) -> Ints:
        """Return the edge of each decision of an episode, ``(t,)`` int64, as positions in `graph_`; learns nothing.

        Raises
        ------
        DataError
            The map has no edges, or as `partial_fit`.
        """
        if not len(self._graph.edge_ids):
            raise DataError("the map has no edges: call partial_fit first")
        rows = self._transitions(trajectory)
        return np.searchsorted(self._graph.edge_ids, self._edges.predict_by_descent(rows))

    def to_arrays(self) -> Arrays:
        """Return both trees; a map restored from them goes on bit for bit as this one does."""
        return nest(nodes=self._nodes.to_arrays(), edges=self._edges.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured map returned."""
        nodes, edges = CFTree(self._nodes.config), CFTree(self._edges.config)
        nodes.from_arrays(unnest(arrays, "nodes"))
        edges.from_arrays(unnest(arrays, "edges"))
        if nodes.n_features_in_ not in (0, self.dimension) or edges.n_features_in_ not in (0, self._width):
            raise DataError(
                f"the saved map is not one of states of {self.dimension} numbers and {self.n_actions} actions"
            )
        if edges.n_leaves_ and not nodes.n_leaves_:
            raise DataError("the saved map has edges but no nodes")
        self._nodes, self._edges = nodes, edges
        self._graph = self._read_graph()

    @property
    def _width(self) -> int:
        """Numbers in a transition."""
        return 2 * self.dimension + self.n_actions + 1

    def _insert(self, trajectory: Trajectory) -> None:
        # Rows of edges hold every state, so what the edge tree refuses does not reach the node tree.
        self._edges.insert(self._transitions(trajectory))
        self._nodes.insert(trajectory.states)

    def _transitions(self, trajectory: Trajectory) -> NDArray[Any]:
        """Return the decisions of an episode as rows, ``(t, 2·d + n_actions + 1)``."""
        states, actions, rewards = trajectory.states, trajectory.actions, trajectory.rewards
        if states.shape != (actions.size + 1, self.dimension) or actions.ndim != 1 or rewards.shape != actions.shape:
            raise DataError(
                f"expected states (t + 1, {self.dimension}), actions (t,) and rewards (t,), "
                f"got {states.shape}, {actions.shape} and {rewards.shape}"
            )
        if actions.dtype.kind not in "iu" or ((actions < 0) | (actions >= self.n_actions)).any():
            raise DataError(f"every action must be a whole number from 0 to {self.n_actions - 1}")
        weighed = rewards.astype(np.float64)[:, None] * self.config.reward_weight  # (t, 1)
        return np.concatenate([states[:-1], states[1:], np.eye(self.n_actions)[actions], weighed], axis=1)

    def _read_graph(self) -> MapGraph:
        """Read the centroids of both trees as a graph."""
        d, nodes, edges = self.dimension, self._nodes, self._edges
        # A tree that saw no row yet does not know its width.
        rows = edges.leaf_means_.reshape(-1, self._width)  # (m, 2·d + n_actions + 1)
        node_ids = nodes.leaf_ids_.copy()
        graph = MapGraph(
            node_ids=node_ids,
            node_means=nodes.leaf_means_.reshape(-1, d).copy(),
            node_counts=nodes.leaf_counts_.copy(),
            edge_ids=edges.leaf_ids_.copy(),
            sources=self._positions(rows[:, :d], node_ids),
            targets=self._positions(rows[:, d : 2 * d], node_ids),
            edge_counts=edges.leaf_counts_.copy(),
            rewards=rows[:, -1] / self.config.reward_weight,
            actions=rows[:, 2 * d : -1].copy(),
        )
        for name in MapGraph.__dataclass_fields__:
            getattr(graph, name).flags.writeable = False
        return graph

    def _positions(self, states: NDArray[Any], node_ids: Ints) -> Ints:
        """Return the places in `node_ids` of the leaves to which `states` descend."""
        if not len(states):
            return np.zeros(0, np.int64)  # the node tree may be empty as well
        return np.searchsorted(node_ids, self._nodes.predict_by_descent(states))
