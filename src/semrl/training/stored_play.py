"""Play that is remembered: perception studies it again and again, then map and models of the world recall it.

What is remembered of an episode is its seed and its actions; it is seen again by playing it again, which is no new
experience. So a stage costs no decisions of its own, and what was seen before perception could see is not lost.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from semrl.core import Observation
from semrl.core.arrays import Arrays, arrays_to_ragged, nest, ragged_to_arrays, unnest
from semrl.core.errors import SemrlError
from semrl.envs import Game, Played
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stages import Stage
from semrl.planning.module import Reasoner


def study(game: Game, pipeline: Pipeline, schooling: Schooling, played: Sequence[Played]) -> Iterator[Stage]:
    """Let each stage learn from the same episodes, from the first on, until perception is ready.

    Yields
    ------
    Stage
        That has learned from an observation, once for each.

    Raises
    ------
    SemrlError
        When a stage would never be complete, since there is nothing in the play that it could learn from.
    """
    while (stage := schooling.current) is not None:
        for observation, action in _seen_again(game, pipeline, played):
            yield schooling.learn(observation, action)
            if schooling.current is not stage:
                break
        else:
            if stage.batches_ >= max(stage.goal, schooling.max_batches):
                seen = sum(len(episode.actions) for episode in played)
                raise SemrlError(
                    f"the stage '{stage.name}' finds nothing to learn from in {seen:,} decisions; "
                    "try more of them with --stability.decisions"
                )


def _seen_again(game: Game, pipeline: Pipeline, played: Sequence[Played]) -> Iterator[tuple[Observation, int | None]]:
    for episode in played:
        pipeline.begin_episode()
        for observation, action, _ in game.again(episode):
            yield observation, action


def recall(game: Game, pipeline: Pipeline, reasoner: Reasoner, played: Sequence[Played]) -> None:
    """Let map and models learn from episodes that were played before perception was ready."""
    for episode in played:
        pipeline.begin_episode()
        reasoner.begin_episode()
        seen = None
        for observation, action, reward in game.again(episode):
            encoded = pipeline.encode(observation)
            if seen is not None and action is not None:
                reasoner.observe(seen, action, reward)
            seen = encoded
        if seen is not None:
            reasoner.end_episode(seen)


def played_to_arrays(played: Sequence[Played]) -> Arrays:
    """Return episodes as arrays."""
    actions = ragged_to_arrays([episode.actions for episode in played], like=np.empty(0, np.int64))
    return {"seeds": np.array([episode.seed for episode in played]), **nest(actions=actions)}


def played_from_arrays(arrays: Arrays) -> list[Played]:
    """Make the episodes again; none of no arrays."""
    if not arrays:
        return []
    actions = arrays_to_ragged(unnest(arrays, "actions"))
    return [Played(seed=int(seed), actions=own) for seed, own in zip(arrays["seeds"], actions, strict=True)]
