"""The state map and the learned rules as an RDF knowledge base with an ontology (§3.4.1).

The thesis keeps its map as a graph and says that it could be "a collection of RDF triples if we wanted": this is it.
"""

import io
import re
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from urllib.parse import quote

import numpy as np
import pyoxigraph as ox

from semrl.core import Ints, MapGraph
from semrl.core.errors import DataError
from semrl.knowledge.vocabulary import CLASSES, INSTANCES, PREFIXES, PROPERTIES, TERMS, prefixes
from semrl.world_model.rules import Rule, sentence

_SIGNS = ("NeutralTransition", "PositiveTransition", "NegativeTransition")  # by sign of the reward: 0, 1, -1

_Statement = tuple[ox.NamedNode, ox.NamedNode, ox.NamedNode | ox.Literal]
_Names = Callable[[str], ox.NamedNode]
"""Names an instance: ``state-3``."""


def to_store(
    graph: MapGraph, action_names: Sequence[str], rules: Sequence[Rule] = (), *, base: str = INSTANCES
) -> ox.Store:
    """Make the knowledge base of a map: the ontology, its states and transitions, the actions, and learned rules.

    Nothing is left to be inferred: superclasses and inverse properties are written out.

    Parameters
    ----------
    graph
        The map.
    action_names
        Name of each column of ``graph.actions``.
    rules
        Of the model of the world, where it has any.
    base
        What the names of all instances begin with, as `RunFolder.base_iri` gives it, so that those of two runs differ.

    Raises
    ------
    DataError
        When there are not as many names as actions.
    """
    store = ox.Store()
    named = partial(_instance, base)
    drawn = [*_states(graph, named), *_transitions(graph, action_names, named)]
    statements = [*_ontology(), *_actions(action_names, named), *drawn, *_rules(rules, named)]
    store.bulk_extend(ox.Quad(*statement) for statement in statements)
    return store


def to_turtle(store: ox.Store, *, base: str = INSTANCES) -> bytes:
    """Write a knowledge base as Turtle, the ontology first; the same one always gives the same bytes."""
    triples = sorted((quad.triple for quad in store), key=_order)
    file = io.BytesIO()
    ox.serialize(triples, file, ox.RdfFormat.TURTLE, prefixes=prefixes(base))
    return file.getvalue()


def most_frequent_actions(graph: MapGraph, action_names: Sequence[str]) -> Ints:
    """Return the action taken most often in each transition, ``(m,)``; the first one among equals.

    Raises
    ------
    DataError
        When there are not as many names as actions.
    """
    if len(action_names) != graph.actions.shape[1]:
        raise DataError(f"{len(action_names)} names for {graph.actions.shape[1]} actions")
    actions: Ints = graph.actions.argmax(axis=1)
    return actions


def _ontology() -> Iterator[_Statement]:
    ontology = ox.NamedNode(TERMS.rstrip("#"))
    about = "What the state map of a run is made of, and the rules by which it predicts."
    yield from _described(ontology, "owl:Ontology", "semrl", about)
    for name, parent, comment in CLASSES:
        node = _node(f"semrl:{name}")
        yield from _described(node, "owl:Class", _words(name), comment)
        if parent:
            yield node, _node("rdfs:subClassOf"), _node(f"semrl:{parent}")
    for prop in PROPERTIES:
        node = _node(f"semrl:{prop.name}")
        is_data = prop.range.startswith("xsd:")
        kind = "owl:DatatypeProperty" if is_data else "owl:ObjectProperty"
        yield from _described(node, kind, _words(prop.name), prop.comment)
        yield node, _node("rdfs:domain"), _node(f"semrl:{prop.domain}")
        yield node, _node("rdfs:range"), _node(prop.range if is_data else f"semrl:{prop.range}")
        if prop.inverse:
            yield node, _node("owl:inverseOf"), _node(f"semrl:{prop.inverse}")


def _actions(action_names: Sequence[str], named: _Names) -> Iterator[_Statement]:
    for number, name in enumerate(action_names):
        node = named(_action(name))
        yield from _individual(node, "semrl:Action", name)
        yield node, _node("semrl:actionNumber"), ox.Literal(number)


def _states(graph: MapGraph, named: _Names) -> Iterator[_Statement]:
    for number, count in zip(graph.node_ids.tolist(), graph.node_counts.tolist(), strict=True):
        yield from _cluster("State", number, count, named)


def _transitions(graph: MapGraph, action_names: Sequence[str], named: _Names) -> Iterator[_Statement]:
    actions = most_frequent_actions(graph, action_names)
    shares = np.take_along_axis(graph.actions, actions[:, None], axis=1)[:, 0]
    ends = (graph.node_ids[graph.sources].tolist(), graph.node_ids[graph.targets].tolist())
    taken = (actions.tolist(), shares.tolist(), graph.rewards.tolist(), graph.reward_signs.tolist())
    edges = zip(graph.edge_ids.tolist(), graph.edge_counts.tolist(), *ends, *taken, strict=True)
    for number, count, start, end, action, share, reward, sign in edges:
        node, source, target = named(f"transition-{number}"), named(f"state-{start}"), named(f"state-{end}")
        yield from _cluster("Transition", number, count, named)
        yield node, _node("rdf:type"), _node(f"semrl:{_SIGNS[sign]}")
        yield node, _node("semrl:source"), source
        yield node, _node("semrl:target"), target
        yield source, _node("semrl:outgoing"), node
        yield target, _node("semrl:incoming"), node
        yield source, _node("semrl:leadsTo"), target
        yield node, _node("semrl:action"), named(_action(action_names[action]))
        yield node, _node("semrl:actionShare"), ox.Literal(share)
        yield node, _node("semrl:reward"), ox.Literal(reward)


def _rules(rules: Sequence[Rule], named: _Names) -> Iterator[_Statement]:
    for number, rule in enumerate(rules):
        node = named(f"rule-{number}")
        yield from _individual(node, "semrl:Rule", f"{rule.about}: {sentence(rule)}")
        yield node, _node("semrl:about"), ox.Literal(rule.about)
        yield node, _node("semrl:change"), ox.Literal(rule.value)
        yield node, _node("semrl:support"), ox.Literal(rule.decisions)
        yield node, _node("semrl:error"), ox.Literal(rule.error)
        for condition in rule.conditions:
            yield node, _node("semrl:condition"), ox.Literal(condition)


def _cluster(kind: str, number: int, count: int, named: _Names) -> Iterator[_Statement]:
    """Yield what states and transitions have in common."""
    node = named(f"{kind.lower()}-{number}")
    yield from _individual(node, f"semrl:{kind}", f"{kind.lower()} {number}")
    yield node, _node("rdf:type"), _node("semrl:Cluster")
    yield node, _node("semrl:number"), ox.Literal(number)
    yield node, _node("semrl:count"), ox.Literal(count)


def _individual(node: ox.NamedNode, kind: str, label: str) -> Iterator[_Statement]:
    """Yield what an instance is; OWL's tools list those that are declared to be individuals."""
    yield from _described(node, kind, label)
    yield node, _node("rdf:type"), _node("owl:NamedIndividual")


def _described(node: ox.NamedNode, kind: str, label: str, comment: str = "") -> Iterator[_Statement]:
    yield node, _node("rdf:type"), _node(kind)
    yield node, _node("rdfs:label"), ox.Literal(label)
    if comment:
        yield node, _node("rdfs:comment"), ox.Literal(comment)


@lru_cache(maxsize=4096)
def _node(name: str) -> ox.NamedNode:
    """Return the node of a prefixed name."""
    prefix, _, local = name.partition(":")
    return ox.NamedNode(PREFIXES[prefix] + local)


@lru_cache(maxsize=4096)
def _instance(base: str, local: str) -> ox.NamedNode:
    """Return the node of an instance."""
    return ox.NamedNode(base + local)


def _action(name: str) -> str:
    return f"action-{quote(name, safe='')}"


def _words(name: str) -> str:
    """Return ``positive transition`` for ``PositiveTransition``."""
    return re.sub("(?<=.)([A-Z])", r" \1", name).lower()


def _order(triple: ox.Triple) -> tuple[bool, str, bool, str, str]:
    """Order the ontology before what it is about, types first, and state 2 before state 10."""
    subject, predicate, value = (str(part) for part in triple)
    is_type = predicate.endswith("#type>")
    return not subject.startswith(f"<{TERMS[:-1]}"), _padded(subject), not is_type, predicate, _padded(value)


def _padded(text: str) -> str:
    return re.sub(r"\d+", lambda digits: digits[0].zfill(20), text)
