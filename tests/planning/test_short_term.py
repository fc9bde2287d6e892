"""Which sequences of actions are tried (§3.4.3)."""

import itertools

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.planning import ShortTermConfig, action_sequences
from semrl.planning.short_term import MAX_SCENARIOS, refined_sequences

DRAWN = ShortTermConfig(depth=20, scenarios=32)


@pytest.mark.parametrize("n_actions", [1, 2, 6])
def test_drawn_sequences_change_their_action_now_and_then(n_actions):
    pool = np.concatenate([action_sequences(n_actions, DRAWN, number=number) for number in range(64)])
    assert pool.shape == (64 * 32, 20) and set(pool.ravel().tolist()) == set(range(n_actions))
    if n_actions > 1:
        held = (pool[:, 1:] == pool[:, :-1]).all(axis=1).mean()
        turns = (pool[:, 2:] != pool[:, :-2]).mean(axis=1)  # two actions that alternate are no change
        assert 0.02 < held < 0.6 and np.median(turns) < 0.3


def test_every_decision_tries_others_and_may_be_tried_again():
    first, second = (action_sequences(2, DRAWN, number=number) for number in (3, 4))
    assert (first != second).any()
    np.testing.assert_array_equal(first, action_sequences(2, DRAWN, number=3))


@pytest.mark.parametrize("left", [1, 12, 20, 30])
def test_some_begin_like_the_plan_before_and_one_is_that_plan(left):
    proposed = np.random.default_rng(0).integers(2, size=left)
    plan = np.append(proposed, np.repeat(proposed[-1], 20))[:20]
    sequences, fresh = (action_sequences(2, DRAWN, number=5, proposed=kept) for kept in (proposed, None))
    np.testing.assert_array_equal(sequences[0], plan)  # its last action is held where it ends too soon
    np.testing.assert_array_equal(sequences[8:], fresh[8:])
    for row, drawn in zip(sequences[1:8], fresh[1:8], strict=True):
        assert any((row[:k] == plan[:k]).all() and (row[k:] == drawn[k:]).all() for k in range(20))
    np.testing.assert_array_equal(fresh, action_sequences(2, DRAWN, number=5, proposed=np.zeros(0, np.int64)))


@pytest.mark.parametrize("elites", [1, 3, 8])
def test_a_second_round_changes_one_stretch_of_each_of_the_best(elites):
    config = ShortTermConfig(depth=20, refined=48)
    best = np.random.default_rng(0).integers(6, size=(elites, 20))
    changed = [refined_sequences(best, 6, config, number=number) != np.resize(best, (48, 20)) for number in range(64)]
    longest = [np.ptp(np.flatnonzero(row)) + 1 for rows in changed for row in rows if row.any()]
    assert max(longest) == 10 and len(longest) > 0.5 * 64 * 48
    assert (np.mean(changed, axis=(0, 1)) > 0.1).all()  # every decision is drawn anew in some, the first as well
    np.testing.assert_array_equal(
        refined_sequences(best, 6, config, number=3), refined_sequences(best, 6, config, number=67)
    )


@pytest.mark.parametrize(("n_actions", "depth"), [(3, 4), (2, 1), (1, 3), (6, 4)])
def test_every_sequence_is_there_once(n_actions, depth):
    sequences = action_sequences(n_actions, ShortTermConfig(depth=depth))
    assert sequences.tolist() == [list(chosen) for chosen in itertools.product(range(n_actions), repeat=depth)]
    assert sequences.dtype == np.int64


def test_the_defaults_are_the_thesiss():
    assert ShortTermConfig().scenarios == 0
    assert len(action_sequences(3, ShortTermConfig())) == 3 ** ShortTermConfig().depth


def test_what_callers_share_cannot_be_changed():
    sequences = action_sequences(2, ShortTermConfig(depth=3))
    with pytest.raises(ValueError, match="read-only"):
        sequences[0, 0] = 1
    assert action_sequences(2, ShortTermConfig(depth=4)).shape == (16, 4)  # no other's


def test_too_many_scenarios_are_refused():
    assert len(action_sequences(4, ShortTermConfig(depth=6))) == 4096 == MAX_SCENARIOS
    assert len(action_sequences(2, ShortTermConfig(depth=12))) == 4096
    for n_actions, depth in ((4, 7), (2, 13), (17, 3), (4097, 1)):
        with pytest.raises(UsageError, match=r"choose a smaller scenarios\.depth"):
            action_sequences(n_actions, ShortTermConfig(depth=depth))


@pytest.mark.parametrize("depth", [5_000, 10**9])
def test_far_too_many_are_refused_in_one_short_line(depth):
    with pytest.raises(UsageError) as refused:
        action_sequences(18, ShortTermConfig(depth=depth))
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize(
    "values",
    [
        {"depth": 0},
        {"depth": -1},
        {"scenarios": -1},
        {"scenarios": 4097},
        {"warm_start_fraction": 1.5},
        {"refined": -1},
        {"refined": 4097},
        {"elites": 0},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        ShortTermConfig(**values)
