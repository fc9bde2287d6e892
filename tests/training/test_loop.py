"""The one environment loop, with a game, an encoder and a planner that only count."""

from types import SimpleNamespace

import numpy as np
import pytest

from semrl.core import Observation, Outcome, State
from semrl.training.loop import EpisodeView, Frames, play


class Countdown:
    """A game of four decisions; every other one pays. Frames hold the number of the decision."""

    def __init__(self):
        self.acted = []

    def reset(self):
        self.acted.clear()
        return self._observation()

    def step(self, action):
        self.acted.append(action)
        n = len(self.acted)
        return Outcome(
            observation=self._observation(),
            reward=float(n % 2),
            training_reward=float(n % 2),
            terminated=n == 4,
            truncated=False,
        )

    def _observation(self):
        return Observation(frame=np.full((1, 1, 3), len(self.acted), np.uint8))


class Counts:
    """An encoder whose states are the frame's number and how many observations its episode has had."""

    def begin(self):
        return SimpleNamespace(encode=self._encoder(), to_arrays=dict, from_arrays=lambda _: None)

    def _encoder(self):
        shown = []

        def encode(observation):
            shown.append(observation)
            return State(vector=np.array([observation.frame[0, 0, 0], len(shown)], np.float32), facts=np.ones(1))

        return encode


class Planner:
    """Notes in which order it is asked what."""

    def __init__(self):
        self.asked = []

    def begin_episode(self, *, learning=False):
        self.asked.append("begin")

    def observe(self, facts, action, reward, things):
        self.asked.append(("observe", action, reward))

    def update_online(self, facts, things):
        self.asked.append("update")

    def plan_step(self, facts, things, *, lists, exploring):
        self.asked.append(("plan", exploring))
        return SimpleNamespace(features=np.array([7.0], np.float32))


def test_an_episode_is_its_beginning_and_what_every_decision_led_to():
    game = Countdown()
    steps = list(play(game, Frames(), lambda step: step.number % 3))
    assert [step.action for step in steps] == [None, 0, 1, 2, 0] and game.acted == [0, 1, 2, 0]
    assert [step.number for step in steps] == [0, 1, 2, 3, 4]
    assert [step.reward for step in steps] == [0, 1, 0, 1, 0] and [step.total for step in steps] == [0, 1, 1, 2, 2]
    assert [step.done for step in steps] == [False] * 4 + [True]
    assert all(step.shown is step.state is step.record is None for step in steps)


@pytest.mark.parametrize("until", [0, 1, 3])
def test_an_episode_goes_on_from_where_it_was_begun(until):
    game = Countdown()
    whole = list(play(game, Frames(), lambda _: 1))
    begun = play(game, Frames(), lambda _: 1)
    for _ in range(until + 1):
        step = next(begun)
    rest = list(play(game, Frames(), lambda _: 1, step))
    assert [(s.number, s.total, s.done) for s in rest] == [(s.number, s.total, s.done) for s in whole[until + 1 :]]


def test_an_agent_is_shown_each_state_beside_the_one_before():
    for _ in range(2):  # every episode has an encoder of its own
        steps = list(play(Countdown(), EpisodeView(Counts()), lambda _: 0))
        states = [[number, number + 1] for number in range(5)]
        assert [step.state.vector.tolist() for step in steps] == states
        shown = [step.shown.vectors.tolist() for step in steps]
        assert shown == [[states[i], states[max(i - 1, 0)]] for i in range(5)]
        assert all(step.shown.plan.shape == (0,) and step.record is None for step in steps)


@pytest.mark.parametrize("exploring", [False, True])
@pytest.mark.parametrize("learning", [False, True])
def test_what_came_is_noted_before_the_next_plan_is_made(exploring, learning):
    planner = Planner()
    view = EpisodeView(Counts(), planner, exploring=exploring, learning=learning)
    steps = list(play(Countdown(), view, lambda step: step.number))
    expected = ["begin", ("plan", exploring)]
    for action, reward in enumerate([1.0, 0.0, 1.0, 0.0]):
        expected += [("observe", action, reward), *(["update"] if learning and reward else []), ("plan", exploring)]
    assert planner.asked == expected
    assert all(step.shown.plan.tolist() == [7] and step.record is not None for step in steps)


def test_where_no_plans_are_asked_for_what_happens_is_noted_all_the_same():
    planner = Planner()
    steps = list(play(Countdown(), EpisodeView(Counts(), planner, plans=False), lambda _: 0))
    assert [asked[0] for asked in planner.asked[1:]] == ["observe"] * 4
    assert all(step.record is None and step.shown.plan.shape == (0,) for step in steps)
