"""A scene in OWL with its world closed: what reasoners, who take nothing for false, need to tell what does not hold."""

import numpy as np
import pyoxigraph as ox

from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.ontology import SCENE, Ontology
from semrl.knowledge.owl import Triples, node, to_triples

SCENE_NAME = "i0"
"""The individual that is the scene itself."""


def closed_scene(words: Ontology, scenes: Interpretation, place: int, base: str) -> list[ox.Triple]:
    """Return an ontology and one scene as RDF: all that holds in it, and that nothing else does.

    Parameters
    ----------
    words
        The ontology.
    scenes
        With roles closed under its axioms; see `semrl.knowledge.compiler.entail`.
    place
        Of the scene among them.
    base
        What all names begin with, ending in ``#`` or ``/``.
    """
    triples = Triples(base, found=list(to_triples(words, base)), blanks=10_000)
    there = np.flatnonzero(scenes.present[place]).tolist()
    names = {
        i: triples.own(list(words.individuals)[i - 1] if 1 <= i <= len(words.individuals) else f"i{i}") for i in there
    }
    triples.add(names[0], "rdf:type", triples.own(SCENE))
    for i, name in names.items():
        triples.add(name, "rdf:type", node("owl:NamedIndividual"))
        for c, concept in enumerate(words.concepts):
            own = triples.own(concept)
            holds = scenes.classes[place, c, i]
            triples.add(name, "rdf:type", own if holds else triples.combined("owl:complementOf", own))
        for r, role in enumerate(words.role_names):
            others = [names[j] for j in there if scenes.roles[place, r, i, j]]
            triples.found += [ox.Triple(name, triples.own(role), other) for other in others]
            only = triples.combined("owl:oneOf", triples.list_of(others)) if others else node("owl:Nothing")
            triples.add(name, "rdf:type", triples.restriction(role, allValuesFrom=only))
        for d, number in enumerate(words.numbers):
            value = float(scenes.numbers[place, d, i])
            if np.isnan(value):
                none = ox.Literal("0", datatype=node("xsd:nonNegativeInteger"))
                triples.add(name, "rdf:type", triples.restriction(number, cardinality=none))
            else:
                triples.found.append(
                    ox.Triple(name, triples.own(number), ox.Literal(repr(value), datatype=node("xsd:double")))
                )
    apart = triples.blank()
    triples.add(apart, "rdf:type", node("owl:AllDifferent"))
    triples.add(apart, "owl:distinctMembers", triples.list_of(list(names.values())))
    return triples.found
