"""How many things move at once in a game, so that a state has room for them.

How long a state is must be known before anything is learned. So what a run will play at random while perception learns
is played once before, to the same seeds: that is no further experience.
"""

from dataclasses import replace

import numpy as np

from semrl.core.errors import SemrlError
from semrl.envs import Game, rom_name
from semrl.envs.actions import Env
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.encoders.objects import ObjectsEncoder
from semrl.perception.tracking.mobility import moving
from semrl.perception.tracking.slots import FEWEST_SLOTS, MOST_SLOTS
from semrl.training.config import RunConfig
from semrl.training.loop import Frames
from semrl.training.stored_play import learn_from_random_play, play_again


def is_counted(config: RunConfig) -> bool:
    """Tell whether a run has as many slots as things move at once, and play from which they can be counted."""
    listed = ENCODERS.load(config.encoder_name) is ObjectsEncoder
    return listed and not config.perception.slot_assigner.slots and config.stability.decisions > 0


def needed_slots(config: RunConfig, env: Env, *, game_seed: int, seed: int) -> int:
    """Return how many slots a run should have: as many as are configured, or one more than things mostly move at once.

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
    counts = []
    for played in stored:
        episode = encoder.begin()
        for step in play_again(game, Frames(), played):
            episode.encode(step.observation)
            counts.append(np.count_nonzero(moving(episode.tracks)))
    return int(np.clip(1 + np.median(counts), FEWEST_SLOTS, MOST_SLOTS))


def with_room(config: PerceptionConfig, slots: int) -> PerceptionConfig:
    """Return how to see so that a state has so many slots."""
    return replace(config, slot_assigner=replace(config.slot_assigner, slots=slots))
