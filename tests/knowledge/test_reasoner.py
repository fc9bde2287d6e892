"""What is decided on arrays, and what the tableau refuses, is what a description logic reasoner (HermiT) says."""

import shutil

import numpy as np
import pyoxigraph as ox
import pytest
from scenes import WORDS, scenes

from semrl.knowledge.closed import SCENE_NAME, closed_scene
from semrl.knowledge.compiler import Classifier, entail, role_axioms
from semrl.knowledge.condition import read_condition
from semrl.knowledge.consistency import satisfiable
from semrl.knowledge.ontology import Definition
from semrl.knowledge.owl import to_triples
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
    words = words or named_words()
    scene = scenes(seed, **(drawn or {"things": 3}))
    entail(scene, role_axioms(words))
    names = list(words.definitions)
    held = Classifier(words).of_scenes(scene, names)[place]
    world = reason(closed_scene(words, scene, place, BASE), tmp_path)
    found = {one.name for one in world[f"{BASE}{SCENE_NAME}"].INDIRECT_is_a if hasattr(one, "name")}
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
