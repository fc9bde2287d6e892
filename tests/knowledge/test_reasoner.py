"""What is decided on arrays, and what the tableau refuses, is what a description logic reasoner (HermiT) says."""

import shutil

import numpy as np
import pyoxigraph as ox
import pytest
from scenes import WORDS, scenes

from semrl.knowledge.compiler import Classifier, entail, role_axioms
from semrl.knowledge.condition import read_condition
from semrl.knowledge.consistency import satisfiable
from semrl.knowledge.ontology import Definition
from semrl.knowledge.owl import node, to_triples
from semrl.knowledge.scene_classes import CHANCE, DANGER, SceneClassesConfig, learn_scene_classes

owlready2 = pytest.importorskip("owlready2", reason="needs the extra 'dl'")
pytestmark = pytest.mark.skipif(shutil.which("java") is None, reason="needs Java, for HermiT")

BASE = "urn:test#"
TEXTS = (
    "ball.x < 30",
    "own and not ball",
    "some(contains, ball and some(touches, own))",
    "only(contains, ball or x <= 20)",
    "at_least(2, contains, ball)",
    "at_most(1, contains, own)",
    "some(contains, value(approaches, left_border))",
    "some(contains, some(threatens, top))",
    "some(contains, some(leftOf, some(leftOf, ball)))",
    "not some(contains, ball and y > 30) or own.x >= 40",
)


def named_words():
    words = WORDS
    for i, text in enumerate(text.replace("top", "thing") for text in TEXTS):
        words = words.having(**{f"C{i}": Definition(expression=read_condition(text, words))})
    return words


def abox(words, scene, s, told):
    """Return the closed ABox of a scene: all that holds, and that nothing else does."""
    n = scene.present.shape[1]
    there = np.flatnonzero(scene.present[s]).tolist()

    def name(i):
        return told.own(list(words.individuals)[i - 1]) if 1 <= i <= len(words.individuals) else told.own(f"i{i}")

    for i in there:
        told.add(name(i), "rdf:type", node("owl:NamedIndividual"))
        if i == 0:
            told.add(name(i), "rdf:type", told.own("Scene"))
        for c, concept in enumerate(words.concepts):
            holds = scene.classes[s, c, i]
            told.add(
                name(i), "rdf:type", told.own(concept) if holds else told._class("owl:complementOf", told.own(concept))
            )
        for r, role in enumerate(words.role_names):
            others = [j for j in range(n) if scene.roles[s, r, i, j]]
            for j in others:
                told.found.append(ox.Triple(name(i), told.own(role), name(j)))
            only = told._class("owl:oneOf", told.list_of([name(j) for j in others])) if others else node("owl:Nothing")
            told.add(name(i), "rdf:type", told.restriction(role, allValuesFrom=only))
        for d, number in enumerate(words.numbers):
            value = scene.numbers[s, d, i]
            if np.isnan(value):
                none = told.restriction(number, allValuesFrom=told._class("owl:complementOf", node("rdfs:Literal")))
                del none  # no facet holds of what has no number: said below
                told.add(
                    name(i),
                    "rdf:type",
                    told.restriction(number, cardinality=ox.Literal("0", datatype=node("xsd:nonNegativeInteger"))),
                )
            else:
                told.found.append(
                    ox.Triple(name(i), told.own(number), ox.Literal(repr(float(value)), datatype=node("xsd:double")))
                )
    blank = told.blank()
    told.add(blank, "rdf:type", node("owl:AllDifferent"))
    told.add(blank, "owl:distinctMembers", told.list_of([name(i) for i in there]))


def reason(triples, tmp_path):
    """Let HermiT classify; return the world."""
    path = tmp_path / "words.nt"
    path.write_bytes(ox.serialize(triples, format=ox.RdfFormat.N_TRIPLES))
    world = owlready2.World()
    ontology = world.get_ontology(path.as_uri()).load()
    with ontology:
        owlready2.sync_reasoner_hermit(world, debug=0)
    return world


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_classes_of_scenes_are_those_that_hermit_finds(seed, tmp_path):
    check(seed, tmp_path)


def test_classes_of_a_scene_are_those_that_hermit_finds(tmp_path):
    check(100, tmp_path)


def test_classes_learned_from_play_are_those_that_hermit_finds(tmp_path):
    words = WORDS.having(Law=Definition(expression=read_condition("some(contains, ball and y > 30)", WORDS)))
    play = scenes(5, count=400, things=2)
    entail(play, role_axioms(words))
    bad = Classifier(words).of_scenes(play, ["Law"])[:, 0]
    rewards = [np.array([-1 if one else 1], np.float32) for one in bad]
    learned = learn_scene_classes(WORDS, play, rewards, SceneClassesConfig(within_decisions=1))
    assert set(learned) == {DANGER, CHANCE}
    for place in (bad.argmax(), bad.argmin()):
        check(5, tmp_path, WORDS.having(**learned), int(place), count=400, things=2)


def check(seed, tmp_path, words=None, place=0, **drawn):
    """Compare the classes of a scene, of those that a seed draws, with what HermiT finds."""
    from semrl.knowledge.owl import _Triples

    words = words or named_words()
    scene = scenes(seed, **(drawn or {"things": 3}))
    entail(scene, role_axioms(words))
    names = list(words.definitions)
    held = Classifier(words).of_scenes(scene, names)[place]
    told = _Triples(BASE, found=list(to_triples(words, BASE)), blanks=10_000)
    abox(words, scene, place, told)
    world = reason(told.found, tmp_path)
    found = {one.name for one in world[f"{BASE}i0"].INDIRECT_is_a if hasattr(one, "name")}
    assert [name in found for name in names] == held.tolist()


def test_what_is_refused_is_unsatisfiable_to_hermit(tmp_path):
    """Sound: all that the tableau refuses HermiT refuses; and these are all that HermiT refuses of this list."""
    texts = [
        "ball and not ball",
        "ball.x < 3 and ball.x > 4",
        "at_least(2, contains, ball) and at_most(1, contains, ball)",
    ]
    texts += ["some(contains, ball and own)", "some(contains, border and ball)", "ball.x < 4 and ball.x > 3", "own"]
    words = WORDS
    for i, text in enumerate(texts):
        words = words.having(**{f"C{i}": Definition(expression=read_condition(text, words))})
    refused = {name for name, one in words.definitions.items() if not satisfiable(one.expression, words)}
    world = reason(to_triples(words, BASE), tmp_path)
    assert {one.name for one in world.inconsistent_classes() if one.name != "Nothing"} == refused == {
        "C0", "C1", "C2", "C3", "C4",
    }  # fmt: skip
