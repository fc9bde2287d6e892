"""Scenarios against a plain simulation, one sequence after the other (§3.4.3)."""

import itertools

import numpy as np
import pytest

from semrl.errors import UsageError
from semrl.planner import ShortTermConfig, action_sequences, imagine
from semrl.planner.short_term import MAX_SCENARIOS


class Line:
    """A glider on a line: it keeps its speed and is pushed; it gains by leaving cell 3 with a push to the right."""

    def __init__(self):
        self.asked = []

    def predict(self, states, previous, actions):
        self.asked.append(len(states))
        return states + (states - previous) + (actions[:, None] - 1)

    @staticmethod
    def step(state, previous, action):
        return state + (state - previous) + (action - 1)


class Gain:
    """Needs state, speed and action, so that mixing them up is seen."""

    def __init__(self):
        self.asked = []

    def predict(self, states, previous, actions):
        self.asked.append(len(states))
        gain = (states[:, 0] >= 3) & (actions == 2)
        loss = states[:, 0] - previous[:, 0] < -1
        return np.where(loss, -1, np.where(gain, 1, 0))

    @staticmethod
    def of(state, previous, action):
        if state - previous < -1:
            return -1
        return int(state >= 3 and action == 2)


def simulated(state, previous, sequence):
    """Roll one sequence forward, decision by decision."""
    states, rewards = [], []
    for action in sequence:
        rewards.append(Gain.of(state, previous, action))
        state, previous = Line.step(state, previous, action), state
        states.append([state, 0.0])
    return states, rewards


@pytest.mark.parametrize(("n_actions", "depth", "hold"), [(3, 4, 1), (3, 2, 3), (2, 1, 1), (1, 3, 2), (6, 4, 1)])
def test_every_sequence_is_there_once_and_actions_are_held(n_actions, depth, hold):
    sequences = action_sequences(n_actions, ShortTermConfig(depth=depth, hold_decisions=hold))
    expected = [
        [action for action in chosen for _ in range(hold)]
        for chosen in itertools.product(range(n_actions), repeat=depth)
    ]
    assert sequences.tolist() == expected and sequences.dtype == np.int64
    assert expected == sorted(expected) and len({tuple(row) for row in expected}) == n_actions**depth


def test_the_defaults_are_the_thesiss():
    assert ShortTermConfig().hold_decisions == 1
    assert len(action_sequences(3, ShortTermConfig())) == 3 ** ShortTermConfig().depth


def test_what_callers_share_cannot_be_changed():
    sequences = action_sequences(2, ShortTermConfig(depth=3))
    with pytest.raises(ValueError, match="read-only"):
        sequences[0, 0] = 1
    assert action_sequences(2, ShortTermConfig(depth=3, hold_decisions=2)).shape == (8, 6)  # no other's


def test_too_many_scenarios_are_refused():
    assert len(action_sequences(4, ShortTermConfig(depth=6))) == 4096 == MAX_SCENARIOS
    assert len(action_sequences(2, ShortTermConfig(depth=12))) == 4096
    for n_actions, depth in ((4, 7), (2, 13), (17, 3), (4097, 1)):
        with pytest.raises(UsageError, match=r"choose a smaller short_term\.depth"):
            action_sequences(n_actions, ShortTermConfig(depth=depth))


@pytest.mark.parametrize("depth", [5_000, 10**9])
def test_far_too_many_are_refused_in_one_short_line(depth):
    with pytest.raises(UsageError) as refused:
        action_sequences(18, ShortTermConfig(depth=depth))
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize("values", [{"depth": 0}, {"hold_decisions": 0}, {"depth": -1}])
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        ShortTermConfig(**values)


@pytest.mark.parametrize("previous", [0.0, 1.0, 1.5, -0.5])
@pytest.mark.parametrize("config", [ShortTermConfig(depth=4), ShortTermConfig(depth=2, hold_decisions=2)])
def test_imagined_is_what_a_simulation_would_show(config, previous):
    sequences = action_sequences(3, config)
    line, gain = Line(), Gain()
    state, before = np.array([1.0, 0.0], np.float32), np.array([previous, 0.0], np.float32)

    class Flat(Line):
        def predict(self, states, previous, actions):
            moved = super().predict(states, previous, actions)
            moved[:, 1] = 0
            return moved

    line = Flat()
    scenarios = imagine(state, before, sequences, line, gain)
    assert len(scenarios) == len(sequences) and scenarios.states.dtype == np.float32
    np.testing.assert_array_equal(scenarios.actions, sequences)
    for i, sequence in enumerate(sequences.tolist()):
        states, rewards = simulated(1.0, previous, sequence)
        assert scenarios.states[i].tolist() == states, sequence
        assert scenarios.rewards[i].tolist() == rewards, sequence
    assert {-1, 1} <= set(scenarios.rewards.ravel().tolist())
    assert line.asked == [len(sequences)] * sequences.shape[1]  # all at once, one decision after the other
    assert (state.tolist(), before.tolist()) == ([1, 0], [previous, 0])


def test_speed_is_taken_along():
    sequences = np.array([[1, 1, 1]])  # never pushed
    for previous, expected in ((0.0, [2, 3, 4]), (1.0, [1, 1, 1]), (3.0, [-1, -3, -5])):
        scenarios = imagine(np.array([1.0]), np.array([previous]), sequences, Line(), Gain())
        assert scenarios.states[0, :, 0].tolist() == expected
