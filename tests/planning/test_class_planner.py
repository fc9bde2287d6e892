"""Classes of scenes move the choice between scenarios, and by just what they are worth."""

import numpy as np
import pytest

from semrl.core import History, Plan, Scenarios
from semrl.planning.class_planner import ClassPlanner

HISTORY = History(states=np.zeros((1, 1), np.float32))


class Fixed:
    """A planner that has already ranked what it imagines."""

    depth = 3

    def __init__(self, returns):
        self.returns = np.array(returns, float)

    def plan(self, _history, _knowledge, *, exploring=False, first=None):
        del exploring, first
        s = len(self.returns)
        states = np.repeat(np.arange(s, dtype=np.float32), self.depth).reshape(s, self.depth, 1)
        scenarios = Scenarios(
            actions=np.repeat(np.arange(s), self.depth).reshape(s, self.depth),
            states=states,
            rewards=np.zeros((s, self.depth), np.float32),
            values=np.zeros(s, np.float32),
        )
        nodes = np.arange(s)
        return Plan(node=0, path=nodes, scenarios=scenarios, returns=self.returns, end_nodes=nodes, progress=nodes)


class Judge:
    def __init__(self, worths):
        self.worths = np.array(worths, float)

    def worth(self, states, _start):
        assert states.shape[2] == 1
        return self.worths[states[..., 0].astype(int), np.arange(states.shape[1])]


@pytest.mark.parametrize(
    ("returns", "worths", "best"),
    [
        ([1.0, 0.9, 0.0], [[0, 0, 0]] * 3, 0),  # nothing to judge: as planned
        ([0.0, 0.0, 0.0], [[-1, -1, -1], [0, 0, 0], [0, 0, 0]], 1),  # danger is left, the order kept
        ([0.0, 0.0, 0.0], [[0, 0, 0], [0, 0, 0], [0, 0, 1]], 2),  # a chance is sought
        ([0.9, 0.0, 0.0], [[0, 0, -1], [0, 0, 0], [0, 0, 0]], 0),  # a reward outweighs a little danger
        ([0.5, 0.0, 0.0], [[-1, -1, -1], [0, 0, 0], [0, 0, 0]], 1),  # and much danger a part of a reward
    ],
)
def test_the_best_is_what_return_and_classes_say_together(returns, worths, best):
    planner = ClassPlanner(Fixed(returns), Judge(worths), discount=1.0)
    plan = planner.plan(HISTORY, None)
    assert plan.actions.tolist() == [best] * 3
    expected = np.array(returns) + np.mean(worths, axis=1)
    np.testing.assert_allclose(plan.returns, np.sort(expected)[::-1])
    np.testing.assert_allclose(plan.returns, expected[plan.end_nodes])
    assert (planner.decisions, planner.changed) == (1, int(best != 0))


def test_what_comes_sooner_counts_more():
    soon, late = [[-1, 0, 0], [0, 0, -1]]
    planner = ClassPlanner(Fixed([0.0, 0.0]), Judge([soon, late]), discount=0.5)
    assert planner.plan(HISTORY, None).actions[0] == 1
    assert planner.depth == 3
