"""Perception as the experiments need it: pretrained on random play, and what it makes of further play."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, reduce
from itertools import islice
from typing import Any

import numpy as np

from semrl.core import Objects, Observation, SceneGraph
from semrl.envs import Game, make_env, rom_name
from semrl.perception.config import EMBEDDERS
from semrl.perception.embedding.protocol import Embedder
from semrl.perception.encoders import ENCODERS, Encoder
from semrl.perception.perception import Perception
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stages import ClustererStage, ReducerStage
from semrl.training import RunConfig, preset
from semrl.training.config import from_dict, merge, write_toml

PLAY_SEED, NEW_RUN_SEED = 100, 1_000
"""Added to the seed of pretraining: for more play to learn from, and for "an entirely new run" (§4.1)."""

_BY_FRAME = {"encoder": "scene", "perception": {"birch": {"threshold": 0.5}}}


@dataclass(frozen=True, kw_only=True)
class Pretrained:
    """An encoder that has learned to see, and how it went.

    Attributes
    ----------
    encoder, perception
        It, and the boxes that it looks through; only its embedder has not learned.
    stability
        Stage → measured value at each batch from the 251st on.
    batches
        Stage → batches it took.
    """

    encoder: Encoder
    perception: Perception
    stability: dict[str, list[float]]
    batches: dict[str, int]


def by_frame(name: str, *settings: Mapping[str, Any]) -> RunConfig:
    """Return a preset with scenes as single frames show them, as §4.1 tests them; the last setting wins."""
    return preset(name, "semantic", reduce(merge, settings, _BY_FRAME))


def pretrain(config: RunConfig, encoder_name: str) -> Pretrained:
    """Let an encoder learn everything but its embedding, on random play (§3.2.3); the newest ones are kept."""
    return _pretrain(write_toml(config), encoder_name)


@lru_cache(maxsize=8)
def _pretrain(written: str, encoder_name: str) -> Pretrained:
    config = from_dict(tomllib.loads(written), source="the experiment")
    rom = rom_name(make_env(config.env, config.environment))
    encoder = ENCODERS.load(encoder_name)(config.perception, rom=rom, planning=False)
    assert encoder.perception is not None, "experiments ask for encoders that see objects"
    stages = [stage for stage in encoder.stages(config.stability) if stage.name != "embedding"]
    schedule, play = PretrainingSchedule(stages, config.stability), _decisions(config, config.seed)
    while schedule.current:
        schedule.learn(*next(play))
    return Pretrained(
        encoder=encoder,
        perception=encoder.perception,
        stability={
            stage.name: stage.test.values_ for stage in stages if isinstance(stage, ReducerStage | ClustererStage)
        },
        batches={stage.name: stage.batches_ for stage in stages},
    )


def make_embedder(config: RunConfig) -> Embedder:
    """Make the embedder of a configuration, which has learned nothing."""
    return EMBEDDERS.make(config.perception.embedder, config.perception)


def random_play(config: RunConfig, seed: int) -> Iterator[Observation]:
    """Act at random and yield what is seen, episode after episode, without end."""
    return (observation for observation, _ in _decisions(config, seed))


def new_run(config: RunConfig, most: int | None) -> Iterator[Observation]:
    """Yield one random episode that nothing was learned from, cut after so many frames."""
    return islice((observation for observation, _ in _episode(config, config.seed + NEW_RUN_SEED)), most)


def objects_of(perception: Perception, play: Iterator[Observation]) -> Iterator[Objects]:
    """Yield the objects of every frame."""
    return (perception.objects(observation) for observation in play)


def scenes_of(perception: Perception, play: Iterator[Observation]) -> list[SceneGraph]:
    """Return the scene of every frame."""
    return [perception.scene(observation) for observation in play]


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
