"""A scene with its world closed, as triples; what HermiT makes of it is in test_reasoner."""

import numpy as np
import pyoxigraph as ox
from scenes import WORDS, scenes

from semrl.knowledge.closed import SCENE_NAME, closed_scene
from semrl.knowledge.compiler import entail, role_axioms
from semrl.knowledge.owl import node

BASE = "urn:test#"


def test_what_holds_is_told_and_nothing_else():
    scene = scenes(2, things=3)
    entail(scene, role_axioms(WORDS))
    told = set(closed_scene(WORDS, scene, 0, BASE))
    there = np.flatnonzero(scene.present[0])
    named = [*WORDS.individuals]
    names = {i: ox.NamedNode(BASE + (named[i - 1] if 1 <= i <= len(named) else f"i{i}")) for i in there}
    assert names[0] == ox.NamedNode(BASE + SCENE_NAME)
    for i, name in names.items():
        for c, concept in enumerate(WORDS.concepts):
            said = ox.Triple(name, node("rdf:type"), ox.NamedNode(BASE + concept)) in told
            assert said == scene.classes[0, c, i]
        for r, role in enumerate(WORDS.role_names):
            for j, other in names.items():
                said = ox.Triple(name, ox.NamedNode(BASE + role), other) in told
                assert said == scene.roles[0, r, i, j]
