"""What the agent is told of a plan (§3.4.4)."""

import itertools

import numpy as np
import pytest

from semrl.core import Plan, Scenarios
from semrl.core.errors import UsageError
from semrl.grounding import PlanFeatures, PlanFeaturesConfig
from semrl.training import preset

ALL = ("actions", "state", "reward")
N_ACTIONS = 3


def a_plan():
    """Two scenarios, the better one first."""
    nowhere = np.array([-1, -1])
    return Plan(
        node=-1,
        path=np.zeros(0, np.int64),
        scenarios=Scenarios(
            actions=np.array([[2, 0, 1], [1, 1, 1]]),
            states=np.arange(12, dtype=np.float32).reshape(2, 3, 2),
            rewards=np.zeros((2, 3), np.float32),
            values=np.zeros(2, np.float32),
        ),
        returns=np.array([1.75, -1.0]),
        end_nodes=nowhere,
        progress=nowhere,
    )


def features(**settings):
    return PlanFeatures(PlanFeaturesConfig(**settings), dimension=2, depth=3, n_actions=N_ACTIONS)


def parts(told):
    return {"actions": [0, 0, 1, 1, 0, 0, 0, 1, 0][: told * N_ACTIONS], "state": [4, 5], "reward": [1.75]}


def test_the_default_is_all_that_the_thesis_lists():
    assert PlanFeaturesConfig().parts == ALL and PlanFeaturesConfig().decisions == 0


@pytest.mark.parametrize(("decisions", "told"), [(0, 3), (1, 1), (2, 2), (3, 3), (7, 3)])
@pytest.mark.parametrize("chosen", [p for n in (1, 2, 3) for p in itertools.permutations(ALL, n)], ids="-".join)
def test_it_is_the_parts_of_the_best_scenario_in_order(chosen, decisions, told):
    grounder = features(parts=chosen, decisions=decisions)
    shown = grounder.ground(a_plan())
    assert shown.tolist() == [number for part in chosen for number in parts(told)[part]]
    assert shown.dtype == np.float32 and len(shown) == grounder.size
    apart = {part: numbers.tolist() for part, numbers in grounder.parts(shown).items()}
    assert list(apart) == list(chosen) and apart == {part: parts(told)[part] for part in chosen}


def test_fewer_than_no_decisions_cannot_be_told():
    with pytest.raises(UsageError, match="decisions"):
        PlanFeaturesConfig(decisions=-1)


def test_the_plan_is_left_alone():
    plan = a_plan()
    shown = features(parts=("state",)).ground(plan)
    shown[:] = 99
    assert plan.scenarios.states.max() < 99


@pytest.mark.parametrize("wrong", [(), ("state", "state"), ("reward", "actions", "reward")])
def test_no_part_and_parts_told_twice_are_refused(wrong):
    with pytest.raises(UsageError, match=r"plan_features\.parts"):
        PlanFeaturesConfig(parts=wrong)


def test_unknown_parts_are_refused():
    with pytest.raises(UsageError, match="parts"):
        preset("semrl", "semantic-map", {"planning": {"plan_features": {"parts": ["colour"]}}})
