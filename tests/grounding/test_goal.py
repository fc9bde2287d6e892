"""What the agent is told of a plan (§3.4.4)."""

import itertools

import numpy as np
import pytest

from semrl.errors import UsageError
from semrl.grounding import GoalConfig, goal_size, ground
from semrl.runs import preset
from semrl.types import Plan, Scenarios

ALL = ("actions", "state", "reward")
N_ACTIONS = 3


def a_plan(hold=1):
    """Two scenarios, the better one first."""
    nowhere = np.array([-1, -1])
    return Plan(
        node=-1,
        path=np.zeros(0, np.int64),
        scenarios=Scenarios(
            actions=np.repeat(np.array([[2, 0, 1], [1, 1, 1]]), hold, axis=1),
            states=np.arange(2 * 3 * hold * 2, dtype=np.float32).reshape(2, 3 * hold, 2),
            rewards=np.zeros((2, 3 * hold), np.int64),
        ),
        returns=np.array([1.75, -1.0]),
        end_nodes=nowhere,
        progress=nowhere,
    )


def parts(hold):
    return {"actions": [0, 0, 1, 1, 0, 0, 0, 1, 0], "state": [6 * hold - 2, 6 * hold - 1], "reward": [1.75]}


def test_the_default_is_all_that_the_thesis_lists():
    assert GoalConfig().parts == ALL


@pytest.mark.parametrize("hold", [1, 4])
@pytest.mark.parametrize("chosen", [p for n in (1, 2, 3) for p in itertools.permutations(ALL, n)], ids="-".join)
def test_it_is_the_parts_of_the_best_scenario_in_order(chosen, hold):
    config = GoalConfig(parts=chosen)
    goal = ground(a_plan(hold), config, hold_decisions=hold, n_actions=N_ACTIONS)
    assert goal.tolist() == [number for part in chosen for number in parts(hold)[part]]
    assert goal.dtype == np.float32
    assert len(goal) == goal_size(config, dimension=2, depth=3, n_actions=N_ACTIONS)


def test_the_plan_is_left_alone():
    plan = a_plan()
    goal = ground(plan, GoalConfig(parts=("state",)), hold_decisions=1, n_actions=N_ACTIONS)
    goal[:] = 99
    assert plan.scenarios.states.max() < 99


@pytest.mark.parametrize("wrong", [(), ("state", "state"), ("reward", "actions", "reward")])
def test_no_part_and_parts_told_twice_are_refused(wrong):
    with pytest.raises(UsageError, match=r"goal\.parts"):
        GoalConfig(parts=wrong)


def test_unknown_parts_are_refused():
    with pytest.raises(UsageError, match="parts"):
        preset("semrl", "semantic-map", {"reasoning": {"goal": {"parts": ["colour"]}}})
