"""How many things move at once in a game, so that a state has room for them.

How long a state is must be known before anything is learned. So what a run will play at random while perception learns
is played once before, to the same seeds: that is no further experience.
"""

from dataclasses import replace

import numpy as np

from semrl.core.errors import SemrlError
from semrl.core.things import LEAST_MOVING_SHARE
from semrl.envs import Game, rom_name
from semrl.envs.actions import Env
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.encoders.objects import ObjectsEncoder, TrackedEpisode
from semrl.perception.tracking.slot_statistics import STEADY_DECISIONS
from semrl.perception.tracking.slots import FEWEST_SLOTS, MOST_SLOTS
from semrl.training.config import RunConfig
from semrl.training.loop import Frames
from semrl.training.stored_play import learn_from_random_play, play_again


def is_counted(config: RunConfig) -> bool:
    """Tell whether a run has as many slots as things move at once, and play from which they can be counted."""
    listed = ENCODERS.load(config.encoder_name) is ObjectsEncoder
    return listed and not config.perception.slot_assigner.slots and config.stability.decisions > 0


def needed_slots(config: RunConfig, env: Env, *, game_seed: int, seed: int) -> int:
    """Return how many slots a run should have: as many as are wanted, or one more than things mostly move at once.

    That is 8 to 12; 8 where perception does not learn from stored play, or finds nothing.

    Parameters
    ----------
    config
        Of the run.
    env
        Its environment; it is to be reset afterwards.
    game_seed, seed
        Of its games, and of its random actions.
    """
    if not is_counted(config):
        return config.perception.slot_assigner.slots or FEWEST_SLOTS
    encoder = ObjectsEncoder(config.perception, rom=rom_name(env), planning=config.plans)
    game = Game(env, game_seed)
    try:
        _, stored = learn_from_random_play(game, encoder, config.stability, np.random.default_rng(seed))
    except SemrlError:  # the run will say what is wrong
        return FEWEST_SLOTS
    moving = []
    for played in stored:
        episode = encoder.begin()
        for step in play_again(game, Frames(), played):
            episode.encode(step.observation)
            moving.append(_count_moving(episode))
    return int(np.clip(1 + np.median(moving), FEWEST_SLOTS, MOST_SLOTS))


def with_room(config: PerceptionConfig, slots: int) -> PerceptionConfig:
    """Return how to see so that a state has so many slots."""
    return replace(config, slot_assigner=replace(config.slot_assigner, slots=slots))


def _count_moving(episode: TrackedEpisode) -> int:
    tracks = episode.tracks
    steady = tracks.visible & (tracks.ages >= STEADY_DECISIONS)
    return int((steady & (tracks.moves >= LEAST_MOVING_SHARE * tracks.ages)).sum())
