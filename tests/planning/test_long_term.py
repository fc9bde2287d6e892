"""Routes against a second, plainer way of finding them."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from semrl.core import MapGraph
from semrl.core.errors import DataError, UsageError
from semrl.planning import LongTermConfig, edge_costs, edges_along, plan_routes

CONFIG = LongTermConfig()


def a_graph(n, edges):
    """A map of n nodes from triples (source, target, mean reward)."""
    m = len(edges)
    sources, targets, rewards = zip(*edges, strict=True) if edges else ((), (), ())
    return MapGraph(
        node_ids=np.arange(n),
        node_means=np.zeros((n, 1)),
        node_counts=np.ones(n, np.int64),
        edge_ids=np.arange(m),
        sources=np.array(sources, np.int64),
        targets=np.array(targets, np.int64),
        edge_counts=np.ones(m, np.int64),
        rewards=np.array(rewards, np.float64),
        actions=np.ones((m, 1)),
    )


def a_random_graph(rng):
    """Few nodes, so that parallel edges, self-loops, cycles and nodes cut off are common."""
    n = int(rng.integers(1, 9))
    m = int(rng.integers(0, 3 * n + 1))
    ends = rng.integers(n, size=(m, 2)).tolist()
    rewards = rng.choice([-1.0, -0.6, -0.3, 0.0, 0.0, 0.0, 0.2, 0.4, 1.0], size=m).tolist()
    return n, [(a, b, reward) for (a, b), reward in zip(ends, rewards, strict=True)]


def cost_of(reward, config):
    if reward >= 0.5:
        return config.positive_cost
    return config.negative_cost if reward <= -0.5 else config.neutral_cost


def bellman_ford(n, edges, config):
    """Cost of the cheapest way from each node to one from which a positive edge leaves."""
    goals = {source for source, _, reward in edges if reward >= 0.5}
    distances = [0.0 if node in goals else math.inf for node in range(n)]
    costs = [(a, b, cost_of(reward, config)) for a, b, reward in edges]
    for _ in range(n):
        for a, b, cost in costs:
            distances[a] = min(distances[a], distances[b] + cost)
    return goals, [d if d <= config.cutoff else math.inf for d in distances]


def cheapest_edges(edges, config):
    cheapest = {}
    for a, b, reward in edges:
        cheapest[a, b] = min(cheapest.get((a, b), math.inf), cost_of(reward, config))
    return cheapest


def test_routes_are_the_cheapest_on_ten_thousand_random_maps():
    rng = np.random.default_rng(0)
    # Costs whose sums are exact, so distances can be compared as they are; cut-offs from harsh to none.
    configs = [LongTermConfig(cutoff=cutoff, negative_cost=cost) for cutoff, cost in ((100, 100), (2, 3), (np.inf, 4))]
    seen = {"goal": 0, "way": 0, "loss": 0, "cut": 0, "none": 0}
    for i in range(10_000):
        (n, edges), config = a_random_graph(rng), configs[i % 3]
        routes = plan_routes(a_graph(n, edges), config)
        goals, distances = bellman_ford(n, edges, config)
        assert routes.distances.tolist() == distances
        assert np.flatnonzero(routes.goals).tolist() == sorted(goals)
        cheapest = cheapest_edges(edges, config)
        for node in range(n):
            path = routes.path(node).tolist()
            costs = [cheapest[step] for step in pairwise(path)]
            if distances[node] == math.inf:
                assert path == [] and routes.next_nodes[node] == -1
                seen["none"] += 1
            else:
                assert path[0] == node and path[-1] in goals and sum(costs) == distances[node]
                assert (routes.next_nodes[node] == -1) == (node in goals)
                seen["goal" if node in goals else "way"] += 1
                seen["loss"] += config.negative_cost in costs
        seen["cut"] += bellman_ford(n, edges, LongTermConfig(negative_cost=4, cutoff=np.inf))[1] != distances
    assert min(seen.values()) > 300, seen


def test_equal_maps_have_equal_routes_whatever_the_order_of_edges():
    rng = np.random.default_rng(1)
    for _ in range(200):
        n, edges = a_random_graph(rng)
        shuffled = [edges[i] for i in rng.permutation(len(edges))]
        first, second = (plan_routes(a_graph(n, order), CONFIG) for order in (edges, shuffled))
        for name in ("distances", "next_nodes", "goals"):
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def chain(length):
    """Nodes 0 … length in a row, a gain behind the last one."""
    return a_graph(length + 1, [*((i, i + 1, 0.0) for i in range(length)), (length, length, 1.0)])


def test_the_cutoff_is_the_last_cost_that_counts():
    routes = plan_routes(chain(101), CONFIG)
    assert routes.distances[0] == math.inf and len(routes.path(0)) == 0
    assert routes.distances[1] == 100
    np.testing.assert_array_equal(routes.path(1), np.arange(1, 102))


def test_a_loss_is_only_taken_when_nothing_else_leads_on():
    detour = a_graph(4, [(0, 3, -1.0), (0, 1, 0.0), (1, 2, 0.0), (2, 3, 0.0), (3, 0, 1.0)])
    assert plan_routes(detour, CONFIG).path(0).tolist() == [0, 1, 2, 3]
    behind = a_graph(3, [(0, 1, 0.0), (1, 2, -1.0), (2, 0, 1.0)])
    assert plan_routes(behind, CONFIG).distances.tolist() == [math.inf, 100, 0]


def test_parallel_edges_are_not_added_up_and_the_cheapest_counts():
    graph = a_graph(2, [(0, 1, -1.0), (0, 1, 0.0), (0, 1, 0.0), (1, 1, 1.0), (0, 0, 0.0)])
    assert plan_routes(graph, CONFIG).distances.tolist() == [1, 0]


@pytest.mark.parametrize(
    "graph", [a_graph(0, []), a_graph(3, []), a_graph(2, [(0, 1, 0.4), (1, 0, -1.0)])], ids=["empty", "bare", "poor"]
)
def test_without_gains_there_are_no_routes(graph):
    routes = plan_routes(graph, CONFIG)
    n = len(graph)
    assert len(routes) == n and not routes.goals.any()
    assert routes.distances.tolist() == [math.inf] * n and routes.next_nodes.tolist() == [-1] * n
    assert all(routes.path(node).shape == (0,) for node in range(n))


def test_types_and_a_goal_alone():
    routes = plan_routes(chain(2), CONFIG)
    assert routes.distances.dtype == np.float64 and routes.next_nodes.dtype == np.int64 and routes.goals.dtype == bool
    assert routes.next_nodes.tolist() == [1, 2, -1]
    path = routes.path(2)
    assert path.tolist() == [2] and path.dtype == np.int64


@pytest.mark.parametrize("node", [-1, 3])
def test_a_node_that_is_not_there_has_no_path(node):
    with pytest.raises(DataError, match="no node"):
        plan_routes(chain(2), CONFIG).path(node)


@pytest.mark.parametrize(
    "values",
    [
        {"neutral_cost": 0.0},
        {"positive_cost": 0.0},
        {"negative_cost": -1.0},
        {"negative_cost": math.inf},
        {"neutral_cost": math.nan},
        {"cutoff": -1.0},
        {"cutoff": math.nan},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        LongTermConfig(**values)


@pytest.mark.parametrize("seed", range(40))
def test_the_edges_along_a_route_cost_what_the_route_costs(seed):
    n, edges = a_random_graph(np.random.default_rng(seed))
    graph = a_graph(n, edges)
    routes, costs = plan_routes(graph, CONFIG), edge_costs(graph, CONFIG)
    for node in range(n):
        path = routes.path(node)
        along = edges_along(graph, path, CONFIG)
        assert graph.sources[along].tolist() == path.tolist()
        if len(path):
            assert graph.targets[along[:-1]].tolist() == path[1:].tolist()
            assert costs[along[:-1]].sum() == pytest.approx(routes.distances[node])
            assert graph.rewards[along[-1]] >= 0.5


def test_of_equally_cheap_edges_the_most_travelled_is_followed():
    graph = a_graph(2, [(0, 1, -1.0), (0, 1, 0.0), (0, 1, 0.0), (1, 0, 1.0), (1, 1, 1.0), (1, 1, 0.0)])
    graph = replace(graph, edge_counts=np.array([9, 2, 3, 1, 2, 7]))
    assert edges_along(graph, np.array([0, 1]), CONFIG).tolist() == [2, 4]


def test_a_way_that_ends_where_no_reward_begins_has_the_edges_between_its_nodes():
    graph = a_graph(3, [(2, 0, 0.0), (0, 1, 0.0), (1, 2, 0.0)])
    goals = np.array([False, False, True])
    path = plan_routes(graph, CONFIG, goals=goals).path(0)
    assert path.tolist() == [0, 1, 2] and edges_along(graph, path, CONFIG).tolist() == [1, 2]
    assert not len(edges_along(graph, path[2:], CONFIG))
