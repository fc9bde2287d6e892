"""Play that is remembered: studied by perception stage by stage, recalled by map and models."""

import dataclasses

import numpy as np
import pytest

from semrl.core.errors import SemrlError
from semrl.envs import Game, make_env
from semrl.perception.config import PipelineConfig
from semrl.perception.detection.grey import to_grey
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.planning.module import Reasoner, ReasoningConfig
from semrl.training.stored_play import played_from_arrays, played_to_arrays, recall, study


class Notes(Schooling):
    """Notes what it is shown, stage by stage."""

    def __init__(self, pipeline, config):
        super().__init__(pipeline, config)
        self.shown = {}

    def learn(self, observation, action=None):
        noted = self.shown.setdefault(self.current.name, [])
        noted.append((observation.frame.tobytes(), action))
        return super().learn(observation, action)


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


def test_every_stage_studies_the_play_from_its_beginning_and_over_again(played):
    game, episodes, diary = played
    pipeline = Pipeline(PipelineConfig(), "classes")
    schooling = Notes(pipeline, StabilityConfig(batches=120, decisions=100))
    assert schooling.stages[0].name == "play" and not schooling.studies
    while not schooling.studies:
        schooling.learn(game.reset())
    stages = list(study(game, pipeline, schooling, episodes))
    assert schooling.current is None
    whole = [(frame, action) for seen in diary for frame, action, _ in seen]
    assert list(dict.fromkeys(stage.name for stage in stages)) == ["threshold", "pca", "birch"]
    for name in ("threshold", "pca", "birch"):
        shown = schooling.shown[name]
        assert shown == (whole * (len(shown) // len(whole) + 1))[: len(shown)]
    assert len(schooling.shown["pca"]) > 120 > len(whole)  # so it was seen more than once


def test_play_without_anything_to_learn_from_is_told(played):
    game, episodes, _ = played
    pipeline = Pipeline(PipelineConfig(), "classes")
    pipeline.detector.partial_fit(to_grey(game.reset().frame))
    nothing = pipeline.detect(game.reset())
    pipeline.detect = lambda _: dataclasses.replace(nothing, crops=nothing.crops[:0])
    schooling = Schooling(pipeline, StabilityConfig(batches=20, max_batches=150, decisions=1))
    schooling.learn(game.reset())
    with pytest.raises(SemrlError, match="'pca' finds nothing to learn from in 100 decisions"):
        list(study(game, pipeline, schooling, episodes))


def test_recalled_play_is_learned_as_if_it_had_been_played(played):
    game, episodes, diary = played
    pipeline = Pipeline(PipelineConfig(), "grey")
    pipeline.encode = lambda observation: np.frombuffer(observation.frame.tobytes(), np.uint8)[:8].astype(np.float32)
    reasoner, learned = Reasoner(ReasoningConfig(), 8, 2, seed=0), []
    reasoner.learn = lambda trajectory: learned.append(trajectory) or {}
    recall(game, pipeline, reasoner, episodes)
    assert [len(trajectory) for trajectory in learned] == [45, 45, 10]
    for trajectory, seen in zip(learned, diary, strict=True):
        assert trajectory.actions.tolist() == [action for _, action, _ in seen[1:]]
        assert trajectory.rewards.tolist() == [reward for _, _, reward in seen[1:]]
        states = [np.frombuffer(frame, np.uint8)[:8] for frame, _, _ in seen]
        np.testing.assert_array_equal(trajectory.states, states)
    assert not len(reasoner._episode)  # nothing is left of it for the next episode


def test_episodes_are_remembered_through_arrays(played):
    _, episodes, _ = played
    again = played_from_arrays(played_to_arrays(episodes))
    assert [episode.seed for episode in again] == [episode.seed for episode in episodes]
    for old, new in zip(episodes, again, strict=True):
        np.testing.assert_array_equal(old.actions, new.actions)
    assert played_from_arrays({}) == []
