"""Whether the rules for people say what a run's world model predicts, which plans are made with."""

import contextlib
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from semrl.core import Trajectory
from semrl.evaluation.player import Player, Policy
from semrl.evaluation.prediction import played
from semrl.evaluation.scores import EVALUATION_SEED, PROBING
from semrl.training.loop import Step
from semrl.training.session import limited_threads
from semrl.world_model.lifted.checking import AHEAD, Check, PredictedEpisode
from semrl.world_model.protocol import WorldModel

CHECKED_DECISIONS = 1_000
"""That are played when nothing else is asked for."""


def check_rules(
    player: Player, *, decisions: int = CHECKED_DECISIONS, on_step: Callable[[Step], None] = lambda _: None
) -> list[Check]:
    """Let the agent play new episodes, and compare the rules about concepts with what came and what was predicted.

    Parameters
    ----------
    player
        One action in a hundred is random; nothing is learned.
    decisions
        So many are played.
    on_step
        Called at every decision.

    Returns
    -------
    list of Check
        One a list, in the order of the rules; none where things are not followed or nothing can be predicted yet.
    """
    planning = player.planning
    if planning is None or not planning.world_model.is_fitted or not planning.concept_rules.rules(player.action_names):
        return []
    return planning.concept_rules.check(predicted_play(player, decisions, on_step=on_step))


def predicted_play(
    player: Player,
    decisions: int,
    *,
    policy: Policy = "agent",
    seed: int | None = None,
    on_step: Callable[[Step], None] = lambda _: None,
) -> list[PredictedEpisode]:
    """Play new episodes, one action in a hundred random, and predict at each decision what the next two bring.

    Parameters
    ----------
    player
        One with a map whose world model can predict.
    decisions
        So many are played; episodes too short to look two ahead are left out.
    policy
        Who plays.
    seed
        Of the episodes; when None, one that training did not use.
    on_step
        Called at every decision.
    """
    assert player.planning is not None, "only models with a map predict"
    probing, world = player.under(exploration=PROBING), player.planning.world_model
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    with limited_threads(player.config.threads), contextlib.closing(probing.new_env()) as env:
        episodes = played(partial(probing.episode, seed=seed, policy=policy, env=env), decisions, on_step)
        return [_predicted(world, steps) for steps in episodes if len(steps) > AHEAD]


def _predicted(world: WorldModel, steps: Sequence[Step]) -> PredictedEpisode:
    """Predict two decisions ahead at each of an episode; of the last one, as if its action were taken again."""
    histories = [step.record.history for step in steps if step.record]
    actions = np.array([step.action for step in steps[1:]], np.int64)
    pairs = np.stack([actions, np.append(actions[1:], actions[-1:])], axis=1)
    imagined = [world.imagine(history, pair[None]) for history, pair in zip(histories, pairs, strict=False)]
    return PredictedEpisode(
        trajectory=Trajectory(
            states=np.array([history.states[0] for history in histories]),
            actions=actions,
            rewards=np.array([step.training_reward for step in steps[1:]], np.float32),
            things=tuple(step.state.things for step in steps if step.state),
        ),
        states=np.array([one.states[0] for one in imagined]),
        rewards=np.array([one.rewards[0] for one in imagined]),
    )
