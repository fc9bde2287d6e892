"""Classes of scenes before losses and gains are found where there is a law, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semrl.knowledge.compiler import Classifier
from semrl.knowledge.condition import read_condition
from semrl.knowledge.expressions import Bottom, Or
from semrl.knowledge.ontology import Definition
from semrl.knowledge.scene_classes import CHANCE, DANGER, SceneClassesConfig, learn_scene_classes, shuffled, soon
from semrl.knowledge.slots import SlotReader, kinds_of, slots_of, words_of
from semrl.knowledge.writing import write_condition

SLOTS = slots_of(["own y", "ball x", "ball y"])
KINDS = [kinds_of(slot, np.ones(3, bool)) for slot in SLOTS]
WORDS = words_of(SLOTS, KINDS)
WITHIN = 4
CONFIG = SceneClassesConfig(within_decisions=WITHIN)
STEP = 0.05


def flights(seed, count=60):
    """A ball flies to the right; at the edge it is a gain where the player is level with it, else a loss."""
    rng = np.random.default_rng(seed)
    places = np.arange(0, 1.001, STEP)
    before, states, rewards = [], [], []
    for _ in range(count):
        own, height = (rng.random(2) * 0.8 + 0.1).round(2) + np.array([0, 0.005])  # never on the border of being level
        facts = np.column_stack([np.full(len(places), own), places, np.full(len(places), height)]).astype(np.float32)
        states.append(facts[:-1])
        before.append(np.concatenate([facts[:1], facts[:-2]]))
        rewards.append(np.zeros(len(places) - 1, np.float32))
        rewards[-1][-1] = 1 if abs(own - height) <= 0.05 else -1
    reader = SlotReader(SLOTS, KINDS, WORDS)
    return reader.read(np.concatenate(states), np.concatenate(before)), rewards


@given(st.lists(st.lists(st.integers(-1, 1), max_size=12), max_size=4), st.integers(1, 20), st.sampled_from([-1, 1]))
def test_soon_is_what_it_says(rewards, within, sign):
    expected = [sign in own[t : t + within] for own in rewards for t in range(len(own))]
    assert soon([np.array(own, np.float32) for own in rewards], sign, within).tolist() == expected


@pytest.mark.parametrize("seed", range(3))
def test_the_law_is_found_and_holds_in_other_play(seed):
    scenes, rewards = flights(seed)
    learned = learn_scene_classes(WORDS, scenes, rewards, CONFIG)
    others, later = flights(seed + 100)
    words = WORDS.having(**learned)
    held = Classifier(words).of_scenes(others, [DANGER, CHANCE])
    law = [read_condition(f"ball.x > 78 and {level}", words) for level in ("not level(ball, own)", "level(ball, own)")]
    truth = Classifier(words, dict(zip("dc", law, strict=True))).of_scenes(others, ["d", "c"])
    assert (held != truth).mean(axis=0).max() < 0.03
    for name, sign in ((DANGER, -1), (CHANCE, 1)):
        assert learned[name].error == 0
        assert learned[name].support == soon(rewards, sign, WITHIN).sum()
        assert held[:, [DANGER, CHANCE].index(name)].sum() == pytest.approx(soon(later, sign, WITHIN).sum(), rel=0.2)


def test_what_is_learned_reads_well():
    scenes, rewards = flights(0)
    learned = learn_scene_classes(WORDS, scenes, rewards, CONFIG)
    assert write_condition(learned[DANGER].expression, WORDS) == "ball.x > 75.0 and not level(ball, own)"


def test_what_is_learned_can_be_written_and_read_again():
    scenes, rewards = flights(0)
    for definition in learn_scene_classes(WORDS, scenes, rewards, CONFIG).values():
        again = read_condition(write_condition(definition.expression, WORDS), WORDS)
        both = Classifier(WORDS, {"a": definition.expression, "b": again}).of_scenes(scenes, ["a", "b"])
        np.testing.assert_array_equal(both[:, 0], both[:, 1])


def test_nothing_is_learned_from_chance_or_too_little():
    scenes, rewards = flights(1)
    rng = np.random.default_rng(1)
    drawn = [rng.permutation(np.append(-1, np.zeros(len(own) - 1))).astype(np.float32) for own in rewards]
    found = learn_scene_classes(WORDS, scenes, drawn, SceneClassesConfig(within_decisions=1))
    assert DANGER not in found or found[DANGER].support < 0.02 * len(scenes)
    rare = [np.zeros_like(own) for own in rewards]
    rare[0][-1] = -1
    assert learn_scene_classes(WORDS, scenes, rare, CONFIG) == {}


def test_what_contradicts_the_ontology_is_refused():
    scenes, rewards = flights(2)
    bounded = replace(WORDS, ranges={("ball", "x"): (0.0, 70.0)})
    assert learn_scene_classes(bounded, scenes, rewards, CONFIG) == {}


@pytest.mark.parametrize("seed", range(4))
def test_shuffled_classes_have_the_same_rules_in_other_places(seed):
    rules = [read_condition(text, WORDS) for text in ("ball.x > 80", "level(ball, own)", "own.y < 20", "ball.y > 60")]
    told = {DANGER: Definition(expression=Or(tuple(rules[:3]))), CHANCE: Definition(expression=rules[3])}
    words = WORDS.having(**told)
    other = shuffled(words, (DANGER, CHANCE), seed=seed).definitions
    dealt = {name: set(_parts(other[name].expression)) for name in told}
    assert set.union(*dealt.values()) == set(rules) and len(dealt[DANGER]) == 3
    assert dealt[DANGER] != set(rules[:3])


def test_where_one_class_was_learned_the_other_one_gets_its_rules():
    words = WORDS.having(**{DANGER: Definition(expression=read_condition("ball.x > 80", WORDS))})
    other = shuffled(words, (DANGER, CHANCE)).definitions
    assert other[CHANCE].expression == words.definitions[DANGER].expression
    assert other[DANGER].expression == Bottom()


def test_rules_of_a_disabled_class_are_not_dealt_out():
    danger, chance = (Definition(expression=read_condition(text, WORDS)) for text in ("ball.x > 80", "own.y < 20"))
    words = WORDS.having(**{DANGER: danger, CHANCE: chance})
    other = shuffled(words, (DANGER, CHANCE), disabled=[DANGER]).definitions
    assert other[DANGER].expression == chance.expression
    assert other[CHANCE].expression == Bottom()


def _parts(expression):
    return expression.parts if isinstance(expression, Or) else (expression,)
