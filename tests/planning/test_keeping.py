"""A plan is kept while what it predicted comes, and no longer."""

import dataclasses

import numpy as np
import pytest

from semrl.core import History, Scenarios
from semrl.core.errors import UsageError
from semrl.planning.keeping import KeepingConfig, PlanKeeper
from semrl.planning.long_term import Routes
from semrl.planning.protocol import Knowledge
from semrl.planning.ranking import rank

DISCOUNT = 0.5


class Line:
    """A map of whole numbers, 0 to 9, which are nodes, and a way to the last."""

    def __init__(self):
        self.graph_ = _Graph()

    def locate(self, states):
        return np.rint(states[:, 0]).astype(np.int64)


class _Graph:
    node_means = np.arange(10.0)[:, None]
    rewards = np.ones(1)

    def __len__(self):
        return 10


ROUTES = Routes(
    distances=np.arange(9.0, -1, -1), next_nodes=np.array([*range(1, 10), -1]), goals=np.arange(10) == 9
)  # fmt: skip
KNOWLEDGE = Knowledge(world_model=None, state_map=Line(), routes=ROUTES)


def plan_from(start, actions, rewards=None):
    """Actions are steps along the line."""
    actions = np.array(actions)
    states = (start + np.cumsum(actions, axis=1))[:, :, None].astype(np.float32)
    scenarios = Scenarios(
        actions=actions,
        states=states,
        rewards=np.zeros(actions.shape, np.float32) if rewards is None else np.array(rewards, np.float32),
        values=np.linspace(1, 2, len(actions), dtype=np.float32),
        uncertainties=np.zeros(len(actions), np.float32),
    )
    return ranked(scenarios, start)


def ranked(scenarios, start):
    where = np.array([[start]], np.float32)
    return rank(scenarios, where, scenarios.states[:, -1], Line(), ROUTES, discount=DISCOUNT)


def history(state, before, action):
    return History(states=np.array([[state], [before]], np.float32), actions=np.array([action]))


def keeper(decisions=9, **settings):
    return PlanKeeper(KeepingConfig(decisions=decisions, **settings), discount=DISCOUNT)


@pytest.mark.parametrize("start", [0, 2])
def test_what_is_left_is_what_a_planner_would_make_of_the_same_scenarios_one_decision_later(start):
    plan = plan_from(start, [[1, 1, 1, 0], [0, 1, 0, 1], [1, 0, 1, 0], [1, 0, 0, 1]])
    kept, held = keeper(), plan
    kept.renew(plan)
    for at in (start + held.actions[0],):
        left = kept.what_is_left(history(at, start, held.actions[0]), 0.0, KNOWLEDGE)
        same = held.scenarios.actions[:, 0] == held.actions[0]
        shifted = Scenarios(
            actions=held.scenarios.actions[same, 1:],
            states=held.scenarios.states[same, 1:],
            rewards=held.scenarios.rewards[same, 1:],
            values=held.scenarios.values[same],
        )
        expected = ranked(shifted, at)
        np.testing.assert_array_equal(left.actions, expected.actions)
        np.testing.assert_allclose(left.returns, expected.returns)
        np.testing.assert_array_equal(left.path, expected.path)
        np.testing.assert_array_equal(left.progress, expected.progress)
        assert left.node == expected.node == at


@pytest.mark.parametrize(
    ("state", "action", "reward", "rewards", "holds"),
    [
        (4.0, 1, 0.0, 0, True),
        (4.004, 1, 0.0, 0, True),
        (4.1, 1, 0.0, 0, False),  # another state than was predicted
        (4.0, 0, 0.0, 0, False),  # another action than was planned
        (4.0, 1, 1.0, 0, False),  # a reward
        (4.0, 1, 0.0, -1, False),  # a reward was predicted and did not come
    ],
)
def test_an_event_or_a_surprise_ends_a_plan(state, action, reward, rewards, holds):
    kept = keeper()
    kept.renew(plan_from(3, [[1, 1, 1]], [[rewards, 0, 0]]))
    assert (kept.what_is_left(history(state, 3.0, action), reward, KNOWLEDGE) is not None) == holds


@pytest.mark.parametrize(("most", "length"), [(0, 5), (2, 5), (9, 4)])
def test_a_plan_ends_after_so_many_decisions_and_at_its_last(most, length):
    kept = keeper(most)
    kept.renew(plan_from(0, [[1] * length]))
    for at in range(1, min(most, length - 1) + 1):
        left = kept.what_is_left(history(at, at - 1, 1), 0.0, KNOWLEDGE)
        assert len(left.actions) == length - at
    at = min(most, length - 1) + 1
    assert kept.what_is_left(history(at, at - 1, 1), 0.0, KNOWLEDGE) is None


def test_a_kept_plan_goes_on_elsewhere():
    kept, other = keeper(3), keeper(3)
    kept.renew(plan_from(0, [[1, 1, 0, 1], [1, 0, 0, 0]]))
    kept.what_is_left(history(1, 0, 1), 0.0, KNOWLEDGE)
    other.from_arrays(kept.to_arrays())
    for at in (2, 2, 3, 3):
        left, again = (each.what_is_left(history(at, 1, int(at == 2)), 0.0, KNOWLEDGE) for each in (kept, other))
        assert (left is None) == (again is None)
        if left is not None:
            np.testing.assert_array_equal(left.scenarios.states, again.scenarios.states)
            np.testing.assert_array_equal(left.returns, again.returns)
    other.from_arrays(keeper().to_arrays())
    assert other.what_is_left(history(2, 1, 1), 0.0, KNOWLEDGE) is None


@pytest.mark.parametrize("wrong", [{"decisions": -1}, {"tolerance": -0.1}, {"tolerance": np.inf}])
def test_wrong_settings(wrong):
    with pytest.raises(UsageError, match="keeping"):
        dataclasses.replace(KeepingConfig(), **wrong)
