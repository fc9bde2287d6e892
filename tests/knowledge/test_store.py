"""The map as RDF: everything that is in the graph and nothing else, with an ontology that says what it means."""

import dataclasses

import numpy as np
import pyoxigraph as ox
import pytest
from graphs import ACTIONS, empty_map, random_map

from semrl.core.errors import DataError
from semrl.knowledge.store import most_frequent_actions, to_store, to_turtle
from semrl.knowledge.vocabulary import CLASSES, PREFIXES, PROPERTIES, prefixes
from semrl.world_model.rules import Rule, sentence

RULES = (
    Rule(about="ball vx", conditions=("x > 90", "vx > 0"), value=-4.0, decisions=212, error=0.5),
    Rule(about="the reward", conditions=(), value=0.0, decisions=215, error=0.0),
)


def select(store, query):
    return [tuple(term.value for term in row) for row in store.query(query, prefixes=prefixes())]


def count(store, pattern):
    return int(select(store, f"SELECT (COUNT(*) AS ?n) {{ {pattern} }}")[0][0])


@pytest.mark.parametrize("graph", [random_map(1), random_map(2, 1, 0), empty_map()], ids=["map", "one node", "empty"])
def test_counts_are_those_of_the_graph(graph):
    store = to_store(graph, ACTIONS)
    assert count(store, "?x a semrl:State") == len(graph)
    assert count(store, "?x a semrl:Transition") == len(graph.edge_ids)
    assert count(store, "?x a semrl:Cluster") == len(graph) + len(graph.edge_ids)
    assert count(store, "?x a semrl:Action") == len(ACTIONS)
    for sign, name in ((1, "Positive"), (-1, "Negative"), (0, "Neutral")):
        assert count(store, f"?x a semrl:{name}Transition") == (graph.reward_signs == sign).sum()
    assert count(store, "?x semrl:leadsTo ?y") == len(set(zip(graph.sources, graph.targets, strict=True)))


def test_every_transition_is_told_whole():
    graph = random_map(3)
    rows = select(
        to_store(graph, ACTIONS),
        "SELECT ?id ?from ?to ?label ?share ?reward ?count { ?t semrl:number ?id; semrl:source/semrl:number ?from; "
        "semrl:target/semrl:number ?to; semrl:action/rdfs:label ?label; semrl:actionShare ?share; "
        "semrl:reward ?reward; semrl:count ?count } ORDER BY ?id",
    )
    ids = graph.node_ids
    assert len(rows) == len(graph.edge_ids)
    for i, (number, start, end, label, share, reward, times) in enumerate(rows):
        assert int(number) == graph.edge_ids[i] and int(times) == graph.edge_counts[i]
        assert (int(start), int(end)) == (ids[graph.sources[i]], ids[graph.targets[i]])
        assert label == ACTIONS[graph.actions[i].argmax()] and float(share) == graph.actions[i].max()
        assert float(reward) == graph.rewards[i]


def test_rules_are_told_with_their_conditions_support_and_error():
    store = to_store(random_map(1), ACTIONS, RULES)
    rows = select(
        store,
        "SELECT ?label ?about ?change ?support ?error { ?r a semrl:Rule; rdfs:label ?label; semrl:about ?about; "
        "semrl:change ?change; semrl:support ?support; semrl:error ?error } ORDER BY ?support",
    )
    for rule, (label, about, change, support, error) in zip(RULES, rows, strict=True):
        assert about == rule.about and label == f"{rule.about}: {sentence(rule)}"
        assert (float(change), int(support), float(error)) == (rule.value, rule.decisions, rule.error)
    assert {row[0] for row in select(store, "SELECT ?c { ?r semrl:condition ?c }")} == set(RULES[0].conditions)


def test_inverses_are_written_out():
    store = to_store(random_map(3), ACTIONS)
    for prop in PROPERTIES:
        if prop.inverse:
            there, back = f"?x semrl:{prop.name} ?y", f"?y semrl:{prop.inverse} ?x"
            assert count(store, there) == count(store, f"{there} . {back}") == 25


def test_all_terms_have_labels_comments_domains_and_ranges():
    store = to_store(random_map(1), ACTIONS, RULES)
    terms = "?p rdfs:label ?l; rdfs:comment ?c"
    assert count(store, f"?p a owl:Class . {terms}") == len(CLASSES)
    properties = f"?p a ?kind; rdfs:domain ?d; rdfs:range ?r . {terms}"
    assert count(store, f"{properties} FILTER(?kind IN (owl:ObjectProperty, owl:DatatypeProperty))") == len(PROPERTIES)
    used = {row[0] for row in select(store, "SELECT DISTINCT ?p { ?s ?p ?o }") if row[0].startswith(PREFIXES["semrl"])}
    assert used == {PREFIXES["semrl"] + prop.name for prop in PROPERTIES}


def test_instances_keep_to_domains_and_ranges():
    store = to_store(random_map(1), ACTIONS, RULES)
    assert count(store, "?p rdfs:domain ?class . ?x ?p ?y FILTER NOT EXISTS { ?x a ?class }") == 0
    assert count(store, "?p a owl:ObjectProperty; rdfs:range ?c . ?x ?p ?y FILTER NOT EXISTS { ?y a ?c }") == 0
    assert count(store, "?p a owl:DatatypeProperty; rdfs:range ?c . ?x ?p ?y FILTER(DATATYPE(?y) != ?c)") == 0
    assert count(store, "?x rdf:type/rdfs:subClassOf ?class FILTER NOT EXISTS { ?x a ?class }") == 0


def test_turtle_comes_back_and_is_the_same_bytes():
    graph = random_map(1)
    store = to_store(graph, ACTIONS, RULES)
    written = to_turtle(store)
    assert written == to_turtle(to_store(graph, ACTIONS, RULES))
    back = ox.Store()
    back.load(written, format=ox.RdfFormat.TURTLE)
    assert set(back) == set(store)
    text = written.decode()
    assert "@prefix semrl: <urn:semrl:ontology#>" in text and "@prefix map: <urn:semrl:map:>" in text
    assert "map:action-FIRE a owl:NamedIndividual , semrl:Action" in text
    assert text.index("semrl:Transition a owl:Class") < text.index("map:state-3 a") < text.index("map:state-12 a")


def test_the_most_frequent_action_is_the_first_of_equals():
    graph = dataclasses.replace(random_map(1, n_edges=2), actions=np.array([[0.2, 0.4, 0.4], [0.0, 0.0, 1.0]]))
    assert most_frequent_actions(graph, ACTIONS).tolist() == [1, 2]
    with pytest.raises(DataError, match="2 names for 3 actions"):
        to_store(graph, ACTIONS[:2])
