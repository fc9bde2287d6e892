"""Random play, and encoders that have learned to see from it."""

from functools import lru_cache

import numpy as np

from semrl.core import Observation
from semrl.envs import Game, make_env
from semrl.perception.clustering import BirchConfig
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import DetectionConfig, ForegroundConfig
from semrl.perception.embedding import HashedEmbeddingConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.tracking import SlotAssignerConfig

# With the thesis's wide threshold a ball may be of one class with pieces of the wall.
CONFIG = PerceptionConfig(
    embedder="hashed",
    hashed=HashedEmbeddingConfig(dimension=32),
    otsu=DetectionConfig(threshold_frames=20),
    foreground=ForegroundConfig(background_frames=50),
    birch=BirchConfig(threshold=0.25),
    slot_assigner=SlotAssignerConfig(frames=60),
)
SOON = StabilityConfig(batches=4, max_batches=40, max_difference=0.0, min_agreement=1.0)
"""Reducer and clusterer take 40 batches each."""

LEARNED = ("grey", "components", "classes", "scene", "tracked_scene", "objects")
"""All encoders that look at frames."""

BLACK = Observation(frame=np.zeros((168, 168, 3), np.uint8))


@lru_cache
def episodes(*lengths: int, seed: int = 0, env: str = "semrl/Catch-v0") -> list[list[tuple[Observation, int | None]]]:
    """Return episodes of random play, each as long as asked for: what is shown, and the action that led there."""
    game, rng = Game(make_env(env), seed), np.random.default_rng(seed)
    played = []
    for length in lengths:
        steps: list[tuple[Observation, int | None]] = [(game.reset(), None)]
        while len(steps) < length:
            action = int(rng.integers(game.n_actions))
            outcome = game.step(action)
            steps.append((outcome.observation, action))
            assert not outcome.done or len(steps) == length
        played.append(steps)
    return played


def play(count: int, seed: int = 0) -> list[tuple[Observation, int | None]]:
    """Return so many observations of Catch, an episode after the other."""
    return [step for episode in episodes(*[46] * (1 + count // 46), seed=seed) for step in episode][:count]


_LEARNED = {}


def schedule_of(encoder, config=SOON):
    """Return what it has to learn."""
    return PretrainingSchedule(encoder.stages(config), config)


def learn_all(schedule, shown):
    """Learn until the stages are over; return the name of the stage of each observation."""
    names = []
    for observation, action in shown:
        if schedule.current is None:
            break
        names.append(schedule.learn(observation, action).name)
    return names


def learned(name, config=CONFIG, *, planning=False):
    """Return an encoder that has learned all it needs. Read only."""
    key = name, repr(config), planning
    if key not in _LEARNED:
        _LEARNED[key] = _learn(name, config, planning=planning)
    return _LEARNED[key]


def _learn(name, config, *, planning):
    encoder = ENCODERS.load(name)(config, planning=planning)
    schedule = schedule_of(encoder)
    learn_all(schedule, play(600))
    assert schedule.current is None and encoder.is_fitted
    return encoder


def relearned(name, config=CONFIG, *, planning=False):
    """Return another encoder that has learned the same."""
    encoder = ENCODERS.load(name)(config, planning=planning)
    encoder.from_arrays(
        {key: array.copy() for key, array in learned(name, config, planning=planning).to_arrays().items()}
    )
    return encoder


def encoded(encoder, observations):
    """Return the states of one episode."""
    episode = encoder.begin()
    return [episode.encode(observation) for observation in observations]


def bits(state):
    """Return all numbers of a state as bytes."""
    return state.vector.tobytes(), state.facts.tobytes()
