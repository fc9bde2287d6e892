"""What is imagined where several things share a place in the state."""

import numpy as np
import pytest

from semrl.core import History, Scenarios
from semrl.planning import LongTermConfig, StateMap, StateMapConfig, plan_routes
from semrl.planning.protocol import Knowledge
from semrl.planning.scenario_planner import ScenarioPlanner, ScenarioPlannerConfig, imagined


class Echo:
    """Predicts of every action the first number of the state as reward; screens all but one scenario away."""

    screens = True

    def imagine(self, history, sequences):
        kept = sequences[:1] if self.screens else sequences
        value = float(history.states[0, 0])
        return Scenarios(
            actions=kept,
            states=np.full((*kept.shape, 2), value, np.float32),
            rewards=np.full(kept.shape, value, np.float32),
            values=np.full(len(kept), 10 * value, np.float32),
            uncertainties=np.full(len(kept), 0.5, np.float32),
        )


def window(value):
    return np.full((3, 2), value, np.float32)


SEQUENCES = np.array([[0, 1], [1, 0], [1, 1]])


def test_what_comes_of_each_thing_is_added_and_nothing_is_left_out():
    world = Echo()
    scenarios = imagined(world, History(states=window(9), lists=(window(1), window(3))), SEQUENCES)
    np.testing.assert_array_equal(scenarios.actions, SEQUENCES)
    assert (scenarios.rewards == 4).all() and (scenarios.values == 40).all() and (scenarios.uncertainties == 1).all()
    assert (scenarios.states == 1).all()
    assert world.screens


@pytest.mark.parametrize(("lists", "value"), [((), 9), ((window(1),), 1)])
def test_one_thing_is_imagined_as_ever(lists, value):
    scenarios = imagined(Echo(), History(states=window(9), lists=lists), SEQUENCES)
    assert len(scenarios) == 1 and (scenarios.rewards == value).all()


def test_a_world_model_of_things_knows_them_all():
    class OfThings(Echo):
        def share(self, concepts):
            """Take note of the concepts."""

    scenarios = imagined(OfThings(), History(states=window(9), lists=(window(1), window(3))), SEQUENCES)
    assert (scenarios.rewards == 9).all()


class Lock:
    """Rewards each action that a hidden sequence has at that place."""

    hidden = np.random.default_rng(1).integers(6, size=16)

    def __init__(self):
        self.asked = []

    def imagine(self, history, sequences):
        self.asked.append(sequences)
        return Scenarios(
            actions=sequences,
            states=np.zeros((*sequences.shape, history.states.shape[1]), np.float32),
            rewards=(sequences == self.hidden).astype(np.float32),
            values=np.zeros(len(sequences), np.float32),
        )


def planned(number=0, first=None, *, learning=False, **settings):
    state_map = StateMap(StateMapConfig(), 2, 6)
    world, routes = Lock(), plan_routes(state_map.graph_, LongTermConfig())
    planner = ScenarioPlanner(ScenarioPlannerConfig(depth=16, **settings), n_actions=6)
    history = History(states=np.zeros((3, 2), np.float32), number=number, learning=learning)
    knowledge = Knowledge(world_model=world, state_map=state_map, routes=routes)
    return planner.plan(history, knowledge, first=first), world


def test_a_second_round_finds_better_plans_than_as_many_sequences_drawn_at_once():
    once, twice = (
        np.mean([planned(number, **settings)[0].returns[0] for number in range(32)])
        for settings in ({"scenarios": 64}, {"scenarios": 32, "refined": 32})
    )
    assert twice > once + 0.3


def test_a_second_round_begins_with_the_best_of_the_first_and_all_are_ranked():
    plan, world = planned(scenarios=20, refined=12, elites=3)
    drawn, refined = world.asked
    assert (len(drawn), len(refined), len(plan.scenarios)) == (20, 12, 32)
    best = drawn[np.argsort(-(drawn == world.hidden).sum(axis=1), kind="stable")[:3]]
    assert ((refined == np.resize(best, refined.shape)).sum(axis=1) >= 8).all()
    assert (np.diff(plan.returns) <= 0).all()
    np.testing.assert_allclose(plan.returns, (plan.scenarios.actions == world.hidden).sum(axis=1))


@pytest.mark.parametrize("first", [0, 5])
def test_all_begin_with_the_action_that_is_asked_for(first):
    plan, world = planned(first=first, scenarios=20, refined=12)
    assert len(world.asked) == 2 and (plan.scenarios.actions[:, 0] == first).all()


def test_what_is_learned_from_is_planned_in_one_round():
    plan, world = planned(learning=True, scenarios=20, refined=12)
    assert len(world.asked) == 1 and len(plan.scenarios) == 20
