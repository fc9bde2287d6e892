"""Exports are read back, whole and the same every time."""

import io
import time
from pathlib import Path

import networkx as nx
import numpy as np
import pyoxigraph as ox
import pytest
from graphs import ACTIONS, empty_map, random_map

from semrl.core.errors import DataError, UsageError
from semrl.knowledge.export import EXPORTERS, exporter, gexf, graphml, turtle
from semrl.knowledge.store import to_store

GRAPH = random_map(1)


def read_graphml(written):
    return nx.read_graphml(io.BytesIO(written), node_type=int, edge_key_type=int, force_multigraph=True)


def read_gexf(written):
    return nx.read_gexf(io.BytesIO(written), node_type=int)


@pytest.mark.parametrize(("write", "read"), [(graphml, read_graphml), (gexf, read_gexf)])
def test_graph_tools_get_every_node_and_edge(write, read):
    network = read(write(GRAPH, ACTIONS))
    assert sorted(network.nodes) == GRAPH.node_ids.tolist() and network.is_directed()
    assert [network.nodes[n]["count"] for n in GRAPH.node_ids.tolist()] == GRAPH.node_counts.tolist()
    found = {
        int(edge.get("id", key)): (start, end, edge) for start, end, key, edge in network.edges(keys=True, data=True)
    }
    assert sorted(found) == GRAPH.edge_ids.tolist()
    for i, number in enumerate(GRAPH.edge_ids.tolist()):
        start, end, edge = found[number]
        assert (start, end) == (GRAPH.node_ids[GRAPH.sources[i]], GRAPH.node_ids[GRAPH.targets[i]])
        assert (edge["count"], edge["sign"]) == (GRAPH.edge_counts[i], GRAPH.reward_signs[i])
        assert edge["reward"] == GRAPH.rewards[i] and edge["action"] == ACTIONS[GRAPH.actions[i].argmax()]
        assert [edge[f"share of {name}"] for name in ACTIONS] == GRAPH.actions[i].tolist()


def test_nodes_lie_where_their_principal_components_are():
    network = read_graphml(graphml(GRAPH, ACTIONS))
    places = np.array([[node["x"], node["y"]] for _, node in sorted(network.nodes(data=True))])
    centred = GRAPH.node_means - GRAPH.node_means.mean(axis=0)
    variances = np.sort(np.linalg.eigvalsh(np.cov(centred.T)))[::-1]
    np.testing.assert_allclose(np.cov(places.T), np.diag(variances[:2]), atol=1e-12)


@pytest.mark.parametrize("dimension", [1, 2])
def test_few_dimensions_are_enough(dimension):
    network = read_graphml(graphml(random_map(1, dimension=dimension), ACTIONS))
    assert len(network) == 9


def test_turtle_is_the_knowledge_base():
    back = ox.Store()
    back.load(turtle(GRAPH, ACTIONS), format=ox.RdfFormat.TURTLE)
    assert set(back) == set(to_store(GRAPH, ACTIONS))


@pytest.mark.parametrize("write", EXPORTERS.values())
def test_bytes_are_the_same_on_any_day(write, monkeypatch):
    first = write(GRAPH, ACTIONS)
    monkeypatch.setattr(time, "strftime", lambda *_: "1999-12-31")
    assert write(GRAPH, ACTIONS) == first


@pytest.mark.parametrize("write", EXPORTERS.values())
def test_an_empty_map_is_an_empty_file_of_its_kind(write):
    assert write(empty_map(), ACTIONS)
    with pytest.raises(DataError, match="2 names for 3 actions"):
        write(GRAPH, ACTIONS[:2])


def test_the_suffix_decides():
    assert exporter(Path("a.GEXF")) is gexf
    for name in ("a.json", "map", ".ttl"):
        with pytest.raises(UsageError, match=r"exported as .graphml, .gexf, .ttl, not as"):
            exporter(Path(name))
