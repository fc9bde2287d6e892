"""What is different in another world, as what a run has learned sees it; and learning that anew, and nothing else.

Of the reflections of the picture the one is taken in which most comes as predicted. What then comes less often as
predicted than in the world of the training has changed: numbers of the facts, the reward, rules about concepts.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import fisher_exact

from semrl.core.errors import UsageError
from semrl.core.state import StateSpace
from semrl.evaluation.games import Asked, play_games
from semrl.evaluation.player import Player
from semrl.evaluation.rule_check import predicted_play
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.planning.module import PlanningModule
from semrl.training.loop import Step
from semrl.training.session import limited_threads
from semrl.world_model.lifted.checking import PredictedEpisode
from semrl.world_model.lifted.events import REWARD
from semrl.world_model.protocol import LearnsAnew
from semrl.world_model.rules import sentence

REFLECTIONS = ("", "mirrored", "upside_down", "mirrored+upside_down")
"""Variants that turn the picture round; the first one leaves it as it is."""

RECOGNISING = 100
"""Decisions that are played with the picture turned in each of these ways."""

_NEAR = 0.01  # of the range of a fact: what is predicted so near came as predicted
_LEAST_DROP = 0.02  # of a share, that counts as a change
_CHANCE = 0.001  # probability of such a drop, or a larger one, where nothing has changed

Mask = NDArray[np.bool_]
Count = tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """How often something came as it was learned, in the world of the training and in the other one."""

    about: str
    right_before: int
    times_before: int
    right_now: int
    times_now: int

    @property
    def is_broken(self) -> bool:
        """Whether it comes so much less often now that chance does not explain it."""
        drop = self.right_before / max(self.times_before, 1) - self.right_now / max(self.times_now, 1)
        if not self.times_now or drop < _LEAST_DROP:
            return False
        table = [[n, of - n] for n, of in ((self.right_now, self.times_now), (self.right_before, self.times_before))]
        return bool(fisher_exact(table, "less").pvalue < _CHANCE)


@dataclass(frozen=True, kw_only=True, slots=True)
class Changes:
    """What is different in a world."""

    variant: str
    reflection: str
    """How the picture must be turned to be seen as before: one of `REFLECTIONS`."""
    expected: dict[str, float]
    """Reflection → share of the decisions in which everything came as predicted."""
    facts: list[Change]
    """Numbers that are predicted, and the reward."""
    rules: list[Change]
    """Rules about concepts: how often each was right when it held."""
    broken: list[int]
    """Which numbers of a state no longer come as predicted; the reward is one past the last."""
    play: list[PredictedEpisode] = field(repr=False, compare=False)
    """What was played of it, turned that way."""


def find_changes(
    player: Player, variant: str, *, decisions: int = 1_000, on_step: Callable[[Step], None] = lambda _: None
) -> Changes:
    """Let the planner play in an altered world and in that of the training, and compare what came with predictions.

    Nothing is learned. One action in a hundred is random.

    Parameters
    ----------
    player
        One with a map whose world model can predict.
    variant
        How the world is altered, see `semrl.envs.variants`.
    decisions
        So many are played in the altered world, `RECOGNISING` of them with the picture turned in each way, and as many
        in the other one.
    on_step
        Called at every decision.

    Raises
    ------
    UsageError
        When too few decisions are asked for, there is no such variant, or its episodes are too short to compare.
    """
    left = decisions - RECOGNISING * len(REFLECTIONS)
    if left < RECOGNISING:
        raise UsageError(f"decisions must be {RECOGNISING * (len(REFLECTIONS) + 1)} or more, not {decisions}")
    planning, space = player.planning, player.encoder.space
    assert planning is not None, "only models with a map predict"
    expected = {
        reflection: _expected(_played(player, turned(variant, reflection), RECOGNISING, on_step), planning, space)
        for reflection in REFLECTIONS
    }
    reflection = max(REFLECTIONS, key=lambda one: expected[one])
    now = _played(player, turned(variant, reflection), left, on_step)
    before = _played(player, player.variant, decisions, on_step)
    numbers = _numbers(before, now, space)
    facts = _facts(before, now, numbers, space)
    return Changes(
        variant=variant,
        reflection=reflection,
        expected=expected,
        facts=facts,
        rules=_rules(player, planning, now),
        broken=[number for number, fact in zip(numbers, facts, strict=True) if fact.is_broken],
        play=now,
    )


def turned(variant: str, reflection: str) -> str:
    """Return a variant whose picture is turned round."""
    return "+".join(part for part in (variant, reflection) if part)


def adapted(player: Player, changes: Changes) -> Player:
    """Return the player in the altered world: it turns the picture, and its planner has learned anew what has changed.

    The world model is that of the player that is given, who knows it from then on too.

    Raises
    ------
    UsageError
        See `require_learning_anew`.
    """
    world, reward = require_learning_anew(player), player.encoder.space.n_facts
    if changes.broken:
        world.learn_anew([one.trajectory for one in changes.play], changes.broken, reward=reward in changes.broken)
    return player.under(variant=turned(changes.variant, changes.reflection))


def planner_returns(
    run: str | Path, player: Player, changes: Changes, episodes: int, on_episode: Callable[[float, int], None]
) -> tuple[list[float], list[float]]:
    """Let the planner of a run play in the altered world, before it adapts and after; return the returns of both.

    They are the games that `semrl.evaluation.evaluate` plays there; see `adapted`.
    """
    seed = player.config.seed + EVALUATION_SEED
    asked = Asked(run=str(run), policy="planner", at=None, conditions=(), seed=seed)

    def returns(who: Player) -> list[float]:
        who = who.under(episodes=episodes)
        with limited_threads(who.config.threads), contextlib.closing(who.new_env()) as env:
            games = play_games(asked, who, env, workers=1, on_episode=on_episode, on_step=lambda _episode, _step: None)
        return [game.total for game in games]

    return returns(player.under(variant=changes.variant)), returns(adapted(player, changes))


def require_learning_anew(player: Player) -> LearnsAnew:
    """Return the world model of a player.

    Raises
    ------
    UsageError
        When it cannot learn some of what it predicts anew.
    """
    world = player.planning.world_model if player.planning else None
    if isinstance(world, LearnsAnew):
        return world
    name = player.config.planning.world_model
    raise UsageError(
        f"the world model '{name}' cannot learn a part anew; ask a run with planning.world_model = 'trees'"
    )


def _played(player: Player, variant: str, decisions: int, on_step: Callable[[Step], None]) -> list[PredictedEpisode]:
    play = predicted_play(player.under(variant=variant), decisions, policy="planner", on_step=on_step)
    if not play:
        raise UsageError(f"episodes of the variant '{variant}' are over after two decisions: nothing can be compared")
    return play


def _numbers(before: Sequence[PredictedEpisode], now: Sequence[PredictedEpisode], space: StateSpace) -> list[int]:
    """Return which numbers of a state are not the same all the time, and one past the last for the reward."""
    states = np.concatenate([one.trajectory.states for play in (before, now) for one in play])
    return [*np.flatnonzero((states != states[0]).any(axis=0)).tolist(), space.n_facts]


def _right(play: Sequence[PredictedEpisode], space: StateSpace) -> tuple[Mask, Mask]:
    """Tell of every decision which numbers, and the reward, came as predicted, ``(n, d + 1)``, and which are known."""
    came = np.concatenate([one.trajectory.states[1:] for one in play])
    predicted = np.concatenate([one.states[:, 0] for one in play])
    rewards = np.sign(np.concatenate([one.trajectory.rewards for one in play]))
    signs = np.sign(np.rint(np.concatenate([one.rewards[:, 0] for one in play])))
    known = np.ones((len(came), space.n_facts + 1), np.bool_)
    if space.seen is not None:
        before = np.concatenate([one.trajectory.states[:-1] for one in play])
        known[:, :-1] = (came[:, space.seen] > 0.5) & (before[:, space.seen] > 0.5)
    return np.column_stack([np.abs(predicted - came) <= _NEAR, signs == rewards]), known


def _expected(play: Sequence[PredictedEpisode], planning: PlanningModule, space: StateSpace) -> float:
    """Return in which share of the decisions all that was known was where such a thing can be, and as predicted."""
    right, known = _right(play, space)
    came = np.concatenate([one.trajectory.states[1:] for one in play])
    low, high = planning.extent.bounds_
    outside = np.column_stack([(came < low - _NEAR) | (came > high + _NEAR), np.zeros(len(came), np.bool_)])
    return float((~known | (right & ~outside)).all(axis=1).mean())


def _facts(
    before: Sequence[PredictedEpisode], now: Sequence[PredictedEpisode], numbers: Sequence[int], space: StateSpace
) -> list[Change]:
    """Compare how often some numbers came as predicted."""
    names = [*space.names, *(f"number {i}" for i in range(len(space.names), space.n_facts)), REWARD]
    counts = [(right & known, known) for right, known in (_right(before, space), _right(now, space))]
    return [
        _change(names[number], *((int(right[:, number].sum()), int(known[:, number].sum())) for right, known in counts))
        for number in numbers
    ]


def _rules(player: Player, planning: PlanningModule, now: Sequence[PredictedEpisode]) -> list[Change]:
    """Compare how often each rule was right in the play that it was read from, and is now."""
    held = planning.concept_rules.held(player.action_names, [one.trajectory for one in now])
    return [
        _change(f"{rule.about}: {sentence(rule)}", (rule.right or 0, rule.decisions), (right, times))
        for rule, right, times in held
    ]


def _change(about: str, before: Count, now: Count) -> Change:
    (right_before, times_before), (right_now, times_now) = before, now
    return Change(
        about=about, right_before=right_before, times_before=times_before, right_now=right_now, times_now=times_now
    )
