"""What is imagined where several things share a place in the state."""

import numpy as np
import pytest

from semrl.core import History, Scenarios
from semrl.planning.scenario_planner import imagined


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
