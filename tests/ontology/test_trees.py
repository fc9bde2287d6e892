"""Trees find sharp rules; asked in compiled code they answer what scikit-learn would."""

from itertools import pairwise

import numpy as np
import pytest
from sklearn.tree import DecisionTreeRegressor
from systems import N_ACTIONS, ball, copied, explained, transitions, walk

from semrl.arrays import digest
from semrl.errors import UsageError
from semrl.ontology import NextStateConfig, NextStateTrees, RewardConfig, RewardTree
from semrl.ontology import make_next_state_model as make_next_state
from semrl.ontology import make_reward_model as make_reward
from semrl.ontology.trees import GROWTH, MAX_DIMENSION, Forest, Memory, relational_features

NEXT, REWARD = NextStateConfig(kind="trees"), RewardConfig(kind="trees")
BOTH = pytest.mark.parametrize("make", [lambda: make_next_state(NEXT, 3, N_ACTIONS),
                                        lambda: make_reward(REWARD, 3, N_ACTIONS)], ids=["next", "reward"])  # fmt: skip


def predicted(model, data):
    return model.predict(data.states, data.previous, data.actions)


def rallies(count, seed=0):
    """A ball flies to the right and turns back where it would cross a bat; a gain where it passes it."""
    rng = np.random.default_rng(seed)
    x, y, bat = rng.integers(0, 20, count), rng.integers(0, 20, count), rng.integers(0, 20, count)
    actions = rng.integers(N_ACTIONS, size=count)
    hit = (x == 19) & (np.abs(y - bat) <= 4)
    now = np.column_stack([x, y, bat])
    after = np.column_stack([np.where(hit, x - 1, x + 1), y, bat + actions - 1])
    return transitions(now, now - [1, 0, 0], actions, after, (x == 19) & ~hit)


def test_it_is_the_trees_of_scikit_learn():
    rng = np.random.default_rng(0)
    rows, wanted = rng.normal(size=(400, 5)).astype(np.float32), rng.normal(size=(400, 2))
    forest, test = Forest(3).fit(rows, wanted), rng.normal(size=(300, 5)).astype(np.float32)
    for data in (rows, test):
        theirs = [
            DecisionTreeRegressor(min_samples_leaf=3, random_state=0).fit(rows, column).predict(data)
            for column in wanted.T
        ]
        np.testing.assert_array_equal(forest(data), np.column_stack(theirs))


def test_numbers_are_seen_in_relation_to_each_other():
    row = relational_features(np.array([[5.0, 2.0]]), np.array([[4.0, 3.0]]), np.array([1]), 2)
    assert row.tolist() == [[5, 2, 1, -1, 0, 1, 3, 6, 1, 5]] and row.dtype == np.float32


def test_sharp_rules_are_learned():
    data, test = rallies(6000), rallies(2000, seed=1)
    next_state = make_next_state(NEXT, 3, N_ACTIONS).partial_fit(data)
    reward = make_reward(REWARD, 3, N_ACTIONS).partial_fit(data)
    assert isinstance(next_state, NextStateTrees) and isinstance(reward, RewardTree)
    told = predicted(next_state, test)
    assert (np.abs(told - test.next_states).max(axis=1) < 0.1).mean() > 0.98
    border = test.states[:, 0] == 19
    assert border.sum() > 50
    assert (np.abs(told - test.next_states).max(axis=1) < 0.1)[border].mean() > 0.9
    assert (predicted(reward, test) == test.rewards)[border].mean() > 0.9
    assert (predicted(reward, test) == test.rewards)[~border].all()


def test_a_bouncing_ball_is_learned():
    data, test = ball(4000), ball(500, seed=7)
    told = predicted(make_next_state(NEXT, 3, N_ACTIONS).partial_fit(data), test)
    assert explained(told - test.states, test.next_states - test.states) > 0.9


@BOTH
def test_before_anything_was_learned_nothing_changes(make):
    model, data = make(), ball(6)
    told = predicted(model, data)
    np.testing.assert_array_equal(told, data.states if told.ndim == 2 else np.zeros(6))


@BOTH
@pytest.mark.parametrize("saved_after", [1, 3, 7])
def test_saved_midway_it_goes_on_bit_for_bit(make, saved_after):
    """Between two growings as well: what is new is not forgotten."""
    lessons = [walk(20, seed).transitions for seed in range(16)]
    unbroken, restored = make(), make()
    restored.partial_fit(lessons[5])  # used before
    for i, lesson in enumerate(lessons):
        if i == saved_after:
            restored.from_arrays(copied(unbroken))
        unbroken.partial_fit(lesson)
        if i >= saved_after:
            restored.partial_fit(lesson)
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    np.testing.assert_array_equal(predicted(restored, lessons[0]), predicted(unbroken, lessons[0]))


def test_trees_grow_anew_when_there_is_enough_to_learn_from():
    memory = Memory(10_000, 3)
    grown = [10 * (i + 1) for i in range(60) if memory.add(walk(10, i).transitions)]
    assert grown[:10] == list(range(10, 110, 10))
    assert all(after >= GROWTH * before for before, after in pairwise(grown))
    assert grown[-1] > 600 / GROWTH - 10


def test_the_oldest_decisions_are_forgotten():
    memory, lessons = Memory(25, 3), [walk(10, seed).transitions for seed in range(4)]
    for lesson in lessons:
        memory.add(lesson)
    for name in ("states", "previous", "actions", "rewards", "next_states"):
        lived = np.concatenate([getattr(lesson, name) for lesson in lessons])
        np.testing.assert_array_equal(getattr(memory.transitions, name), lived[-25:])


@pytest.mark.parametrize("make", [make_next_state, make_reward])
def test_states_too_long_for_trees_are_refused(make):
    config = NEXT if make is make_next_state else REWARD
    make(config, MAX_DIMENSION, N_ACTIONS)
    with pytest.raises(UsageError, match="at most 32 numbers, not 33; use a network"):
        make(config, MAX_DIMENSION + 1, N_ACTIONS)


@pytest.mark.parametrize("config", [NextStateConfig, RewardConfig])
@pytest.mark.parametrize("name", ["leaf_decisions", "capacity"])
def test_bad_parameters_are_refused(config, name):
    with pytest.raises(UsageError, match=name):
        config(**{name: 0})
