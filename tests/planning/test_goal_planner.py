"""Ways to a goal that is given: planned anew when the goal or the map is another."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from semrl.core import MapGraph
from semrl.planning import LongTermConfig
from semrl.planning.goal_planner import GoalPlanner


def a_map(*edges):
    """Three nodes and edges without rewards."""
    sources, targets = np.array(edges).T
    m = len(edges)
    return MapGraph(
        node_ids=np.arange(3), node_means=np.zeros((3, 1)), node_counts=np.ones(3, np.int64), edge_ids=np.arange(m),
        sources=sources, targets=targets, edge_counts=np.ones(m, np.int64), rewards=np.zeros(m),
        actions=np.ones((m, 1)),
    )  # fmt: skip


class Sought:
    """Where one node is sought."""

    def __init__(self, node):
        self.node = node

    def nodes(self, graph):
        return None if self.node is None else np.arange(len(graph)) == self.node


def test_ways_follow_goal_and_map():
    judge, graph = Sought(2), a_map((0, 1), (1, 2))
    planner = GoalPlanner(SimpleNamespace(depth=1), judge, LongTermConfig())

    def way(graph):
        return planner.towards(SimpleNamespace(state_map=SimpleNamespace(graph_=graph), routes="by reward"))

    assert way(graph).path(0).tolist() == [0, 1, 2] and way(graph) is way(graph)
    judge.node = 1
    assert way(graph).path(0).tolist() == [0, 1]
    judge.node = 2
    shorter = replace(graph, targets=np.array([2, 2]))
    assert way(shorter).path(0).tolist() == [0, 2]
    judge.node = None
    assert way(graph) == "by reward"
