"""Stored play: perception learns from it stage by stage, then map and world model do."""

import dataclasses

import numpy as np
import pytest

from semrl.core import State
from semrl.core.arrays import digest
from semrl.core.errors import SemrlError, UsageError
from semrl.envs import Game, make_env
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import DetectionConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.planning.config import PlanningConfig
from semrl.planning.module import PlanningModule
from semrl.training.loop import Frames
from semrl.training.stored_play import play_again, pretrain, stored_from_arrays, stored_to_arrays, warm_start


class Notes(PretrainingSchedule):
    """Notes what it is shown, stage by stage."""

    def __init__(self, encoder, config):
        super().__init__(encoder.stages(config), config)
        self.shown = {}

    def learn(self, observation, action=None):
        noted = self.shown.setdefault(self.current.name, [])
        noted.append((observation.frame.tobytes(), action))
        return super().learn(observation, action)


class Bytes:
    """An encoder whose states are the first bytes of the frame and how many were shown in this episode."""

    def begin(self):
        return BytesEpisode()


class BytesEpisode:
    def __init__(self):
        self.shown = 0

    def encode(self, observation):
        facts = np.append(np.frombuffer(observation.frame.tobytes(), np.uint8)[:8], self.shown).astype(np.float32)
        self.shown += 1
        return State(vector=facts, facts=facts)


@pytest.fixture
def played():
    """Two episodes and a part of a third, and what was seen in them: frames, actions, rewards."""
    game, rng = Game(make_env("semrl/Catch-v0"), 0), np.random.default_rng(0)
    episodes, diary = [], []
    for length in (45, 45, 10):
        seen = [(game.reset().frame.tobytes(), None, 0.0)]
        for _ in range(length):
            action = int(rng.integers(2))
            outcome = game.step(action)
            seen.append((outcome.observation.frame.tobytes(), action, outcome.reward))
        episodes.append(game.played)
        diary.append(seen)
    return game, episodes, diary


def test_stored_play_is_played_again_as_it_was(played):
    game, episodes, diary = played
    for episode, seen in zip(episodes, diary, strict=True):
        steps = list(play_again(game, Frames(), episode))
        assert [(s.observation.frame.tobytes(), s.action, s.reward) for s in steps] == seen
        assert [s.number for s in steps] == list(range(len(seen)))


@pytest.mark.parametrize("name", ["classes", "objects"])
def test_every_stage_learns_from_the_play_from_its_beginning_and_over_again(played, name):
    game, episodes, diary = played
    encoder = ENCODERS.load(name)(PerceptionConfig())
    schedule = Notes(encoder, StabilityConfig(batches=120, decisions=100))
    assert schedule.stages[0].name == "play" and not schedule.uses_stored_play
    while not schedule.uses_stored_play:
        schedule.learn(game.reset())
    stages = list(pretrain(game, schedule, episodes))
    assert schedule.current is None and encoder.is_fitted
    whole = [(frame, action) for seen in diary for frame, action, _ in seen]
    names = [stage.name for stage in schedule.stages[1:]]
    assert list(dict.fromkeys(stage.name for stage in stages)) == names
    for stage in names:
        shown = schedule.shown[stage]
        assert shown == (whole * (len(shown) // len(whole) + 1))[: len(shown)]
    assert len(schedule.shown["reduction"]) > 120 > len(whole)  # so it was seen more than once


def test_play_without_anything_to_learn_from_is_told(played):
    game, episodes, _ = played
    encoder = ENCODERS.load("classes")(PerceptionConfig())
    detector = encoder.perception.detector
    detector.partial_fit(game.reset().frame)
    nothing = detector.detect(game.reset().frame)
    detector.detect = lambda _: dataclasses.replace(nothing, crops=nothing.crops[:0])
    config = StabilityConfig(batches=20, max_batches=150, decisions=1)
    schedule = PretrainingSchedule(encoder.stages(config), config)
    schedule.learn(game.reset())
    with pytest.raises(UsageError, match="the stage 'detection' of perception found no object"):
        list(pretrain(game, schedule, episodes))


def test_play_with_too_little_to_learn_from_is_told(played):
    game, episodes, _ = played
    encoder = ENCODERS.load("classes")(PerceptionConfig(otsu=DetectionConfig(threshold_frames=4)))
    encoder.perception.reducer.partial_fit = lambda _: encoder.perception.reducer  # waits for more objects
    config = StabilityConfig(batches=20, max_batches=150, decisions=1)
    schedule = PretrainingSchedule(encoder.stages(config), config)
    schedule.learn(game.reset())
    with pytest.raises(SemrlError, match="'reduction' finds nothing to learn from in 100 decisions"):
        list(pretrain(game, schedule, episodes))


def test_a_warm_start_learns_as_if_the_play_had_been_the_agents(played):
    game, episodes, diary = played
    planning, learned = PlanningModule(PlanningConfig(), 9, 2, seed=0), []
    fresh = digest(planning.to_arrays())
    planning.learn = lambda trajectory: learned.append(trajectory) or {}
    planning.observe(np.zeros(9, np.float32), 1, 1.0)  # of an episode that was broken off
    warm_start(game, Bytes(), planning, episodes)
    assert [len(trajectory) for trajectory in learned] == [45, 45, 10]
    for trajectory, seen in zip(learned, diary, strict=True):
        assert trajectory.actions.tolist() == [action for _, action, _ in seen[1:]]
        assert trajectory.rewards.tolist() == [reward for _, _, reward in seen[1:]]
        states = [[*np.frombuffer(frame, np.uint8)[:8], i] for i, (frame, _, _) in enumerate(seen)]
        np.testing.assert_array_equal(trajectory.states, states)  # every episode has an encoder of its own
    del planning.learn
    assert digest(planning.to_arrays()) == fresh  # nothing is left of it for the next episode


def test_episodes_are_stored_through_arrays(played):
    _, episodes, _ = played
    again = stored_from_arrays(stored_to_arrays(episodes))
    assert [episode.seed for episode in again] == [episode.seed for episode in episodes]
    for old, new in zip(episodes, again, strict=True):
        np.testing.assert_array_equal(old.actions, new.actions)
    assert stored_from_arrays({}) == []
