"""Sequences of actions rolled forward, against a plain simulation one after the other (§3.4.3)."""

import itertools

import numpy as np
import pytest

from semrl.world_model import roll_forward


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


@pytest.mark.parametrize("previous", [0.0, 1.0, 1.5, -0.5])
def test_imagined_is_what_a_simulation_would_show(previous):
    sequences = np.array(list(itertools.product(range(3), repeat=4)))
    line, gain = Line(), Gain()
    state, before = np.array([1.0, 0.0], np.float32), np.array([previous, 0.0], np.float32)

    class Flat(Line):
        def predict(self, states, previous, actions):
            moved = super().predict(states, previous, actions)
            moved[:, 1] = 0
            return moved

    line = Flat()
    scenarios = roll_forward(state, before, sequences, line, gain)
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
        scenarios = roll_forward(np.array([1.0]), np.array([previous]), sequences, Line(), Gain())
        assert scenarios.states[0, :, 0].tolist() == expected
