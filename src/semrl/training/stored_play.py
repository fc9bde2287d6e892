"""Pretraining on stored play: each stage learns from the same episodes, then map and world model do.

What is stored of an episode is its seed and its actions; it is seen again by playing it again, which is no new
experience. So a stage costs no decisions of its own, and what was seen before perception could see is not lost.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from semrl.core.arrays import Arrays, arrays_to_ragged, nest, ragged_to_arrays, unnest
from semrl.core.errors import SemrlError
from semrl.envs import Game, Played
from semrl.perception.encoders import Encoder
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import Stage
from semrl.planning.module import PlanningModule
from semrl.training.loop import EpisodeView, Frames, Step, View, play


def learn_to_see(
    game: Game,
    encoder: Encoder,
    config: StabilityConfig,
    rng: np.random.Generator,
    planning: PlanningModule | None = None,
) -> int:
    """Let perception learn from random play until it is ready, at one go; return the decisions that were played.

    Where play is stored, map and world model learn from it as well.
    """
    decisions, stored = learn_from_random_play(game, encoder, config, rng)
    if planning:
        warm_start(game, encoder, planning, stored)
    return decisions


def learn_from_random_play(
    game: Game, encoder: Encoder, config: StabilityConfig, rng: np.random.Generator
) -> tuple[int, list[Played]]:
    """Let perception learn until it is ready; return the decisions that were played, and what was stored of them."""
    schedule = PretrainingSchedule(encoder.stages(config), config)
    stored: list[Played] = []
    decisions = 0

    def learn_and_move(step: Step) -> int:
        schedule.learn(step.observation, step.action)
        return int(rng.integers(game.n_actions))

    while schedule.current and not schedule.uses_stored_play:
        for step in play(game, Frames(), learn_and_move):
            decisions += step.number > 0
            if not schedule.current or schedule.uses_stored_play:
                break
        if schedule.stores_play:
            stored.append(game.played)
    for _ in pretrain(game, schedule, stored):
        pass
    return decisions, stored


def pretrain(game: Game, schedule: PretrainingSchedule, stored: Sequence[Played]) -> Iterator[Stage]:
    """Let each stage learn from the same episodes, from the first on, until perception is ready.

    Yields
    ------
    Stage
        That has learned from an observation, once for each.

    Raises
    ------
    UsageError
        When a stage has found nothing in the play.
    SemrlError
        When a stage would never be complete, since there is too little in the play that it could learn from.
    """
    while (stage := schedule.current) is not None:
        for step in (step for episode in stored for step in play_again(game, Frames(), episode)):
            yield schedule.learn(step.observation, step.action)
            if schedule.current is not stage:
                break
        else:
            if stage.batches_ >= max(stage.target, schedule.max_batches):
                stage.require_found()
                seen = sum(len(episode.actions) for episode in stored)
                raise SemrlError(
                    f"the stage '{stage.name}' finds nothing to learn from in {seen:,} decisions; "
                    "try more of them with --stability.decisions"
                )


def warm_start(game: Game, encoder: Encoder, planning: PlanningModule, stored: Sequence[Played]) -> None:
    """Let map and world model learn from episodes that were played before perception was ready."""
    for episode in stored:
        *_, last = play_again(game, EpisodeView(encoder, planning, plans=False), episode)
        assert last.state is not None
        planning.end_episode(last.state.facts, last.state.things)


def play_again(game: Game, view: View, stored: Played) -> Iterator[Step]:
    """Play a stored episode again, as far as it was played."""
    step = view.begin(game.begin(stored.seed))
    yield step
    for action in stored.actions.tolist():
        step = view.follow(step, action, game.step(action))
        yield step


def stored_to_arrays(stored: Sequence[Played]) -> Arrays:
    """Return episodes as arrays."""
    actions = ragged_to_arrays([episode.actions for episode in stored], like=np.empty(0, np.int64))
    return {"seeds": np.array([episode.seed for episode in stored]), **nest(actions=actions)}


def stored_from_arrays(arrays: Arrays) -> list[Played]:
    """Make the episodes again; none of no arrays."""
    if not arrays:
        return []
    actions = arrays_to_ragged(unnest(arrays, "actions"))
    return [Played(seed=int(seed), actions=own) for seed, own in zip(arrays["seeds"], actions, strict=True)]
