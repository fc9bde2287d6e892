"""Perception as the experiments need it: schooled on random play, and what it makes of further play."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, reduce
from itertools import islice
from typing import Any

import numpy as np

from semrl.core import Objects, Observation, SceneGraph
from semrl.envs import Game, make_env, rom_name
from semrl.perception.config import View
from semrl.perception.detection.grey import to_grey
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.training import RunConfig, preset
from semrl.training.config import merge

PLAY_SEED, NEW_RUN_SEED = 100, 1_000
"""Added to the seed of schooling: for more play to learn from, and for "an entirely new run" (§4.1)."""

_BY_FRAME = {"pipeline": {"scene": {"tracked": False}, "birch": {"threshold": 0.5}}}


@dataclass(frozen=True, kw_only=True)
class Schooled:
    """A pipeline that has learned to see, and how it went.

    Attributes
    ----------
    pipeline
        It; only its embedder has not learned.
    stability
        Stage → measured value at each batch from the 251st on.
    batches
        Stage → batches it took.
    """

    pipeline: Pipeline
    stability: dict[str, list[float]]
    batches: dict[str, int]


def by_frame(name: str, *settings: Mapping[str, Any]) -> RunConfig:
    """Return a preset with scenes as single frames show them, as §4.1 tests them; the last setting wins."""
    return preset(name, "semantic", reduce(merge, settings, _BY_FRAME))


@lru_cache(maxsize=8)
def school(config: RunConfig, view: View) -> Schooled:
    """Let a pipeline learn everything but its embedding, on random play (§3.2.3)."""
    pipeline = Pipeline(config.pipeline, view, rom_name(make_env(config.env, config.environment)))
    schooling = Schooling(pipeline, config.stability)
    play = _decisions(config, config.seed)
    learned: dict[str, int] = {}
    while schooling.current and schooling.current.name != "documents":
        observation, action = next(play)
        if action is None:
            pipeline.begin_episode()
        stage = schooling.learn(observation, action)
        learned[stage.name] = stage.batches_
    stability = {stage.name: stage.test.values_ for stage in schooling.stages if hasattr(stage, "test")}
    return Schooled(pipeline=pipeline, stability=stability, batches=learned)


def random_play(config: RunConfig, seed: int) -> Iterator[Observation]:
    """Act at random and yield what is seen, episode after episode, without end."""
    return (observation for observation, _ in _decisions(config, seed))


def new_run(config: RunConfig, most: int | None) -> Iterator[Observation]:
    """Yield one random episode that nothing was learned from, cut after so many frames."""
    return islice((observation for observation, _ in _episode(config, config.seed + NEW_RUN_SEED)), most)


def objects_of(pipeline: Pipeline, play: Iterator[Observation]) -> Iterator[Objects]:
    """Yield the objects of every frame."""
    return (pipeline.detector.detect(to_grey(observation.frame)) for observation in play)


def scenes_of(pipeline: Pipeline, play: Iterator[Observation]) -> list[SceneGraph]:
    """Return the scene of every frame."""
    return [pipeline.scene(to_grey(observation.frame)) for observation in play]


def _decisions(config: RunConfig, seed: int) -> Iterator[tuple[Observation, int | None]]:
    """Act at random and yield what is seen and the action that led there, none at the beginning of an episode."""
    while True:
        yield from _episode(config, seed)
        seed += 1


def _episode(config: RunConfig, seed: int) -> Iterator[tuple[Observation, int | None]]:
    rng = np.random.default_rng(seed)
    game = Game(make_env(config.env, config.environment), seed)
    yield game.reset(), None
    done = False
    while not done:
        action = int(rng.integers(game.n_actions))
        outcome = game.step(action)
        yield outcome.observation, action
        done = outcome.done
