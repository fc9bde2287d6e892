"""The numbers of §4.2, against networkx."""

import dataclasses

import networkx as nx
import numpy as np
import pytest
from graphs import empty_map, random_map

from semrl.knowledge.description import MapDescription, describe


@pytest.mark.parametrize("seed", range(40))
def test_it_agrees_with_networkx(seed):
    graph = random_map(seed, n_nodes=1 + seed % 13, n_edges=seed)
    network = nx.MultiDiGraph(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
    network.add_nodes_from(range(len(graph)))
    size = max(len(part) for part in nx.strongly_connected_components(network))
    part = min((part for part in nx.strongly_connected_components(network) if len(part) == size), key=min)
    told = describe(graph)
    assert (told.nodes, told.edges, told.component_nodes) == (len(graph), seed, size)
    assert told.diameter == nx.diameter(network.subgraph(part))
    assert told.radius == nx.radius(network.subgraph(part))


def test_shares_and_sums():
    graph = dataclasses.replace(
        random_map(1, n_edges=4), rewards=np.array([1.0, 0.5, -0.6, 0.49]), edge_counts=np.array([5, 1, 1, 1])
    )
    told = describe(graph)
    assert (told.positive_share, told.negative_share, told.transitions) == (0.5, 0.25, 8)
    assert told.states == graph.node_counts.sum()


def test_a_directed_diameter_may_be_more_than_two_radii():
    graph = dataclasses.replace(random_map(0, 4, 6), sources=np.array([0, 1, 2, 3, 3, 3]),
                                targets=np.array([1, 2, 3, 0, 1, 2]))  # fmt: skip
    told = describe(graph)
    assert (told.diameter, told.radius) == (3, 1)


def test_a_map_without_edges_and_an_empty_one():
    assert describe(random_map(0, 3, 0)) == MapDescription(
        nodes=3, edges=0, states=int(random_map(0, 3, 0).node_counts.sum()), transitions=0, positive_share=0.0,
        negative_share=0.0, component_nodes=1, diameter=0, radius=0,
    )  # fmt: skip
    told = describe(empty_map())
    assert (told.nodes, told.edges, told.component_nodes, told.diameter, told.radius) == (0, 0, 0, None, None)
