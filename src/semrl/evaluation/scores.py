"""How well a trained run plays: returns of greedy games from random starts."""

import contextlib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semrl.core.errors import SemrlWarning, UsageError
from semrl.evaluation.games import Asked, PlayedGame, play_games, ready_player
from semrl.evaluation.kept import keep_result, warn_unwritable
from semrl.evaluation.player import Player, Policy
from semrl.training.config import ClassesMode, EvaluationConfig
from semrl.training.loop import Step
from semrl.training.session import limited_threads
from semrl.training.world import World

EVALUATION_SEED = 1_000_000
"""Added to a run's seed for its evaluation."""

PROBING = 0.01
"""Probability of a random action where predictions are tested: a game that is always played alike shows little."""


@dataclass(frozen=True, kw_only=True)
class EvaluationResult:
    """Returns of the evaluation episodes."""

    run: str
    policy: str
    episodes: int
    mean: float
    std: float
    min: float
    max: float
    returns: list[float]
    lengths: list[int]
    """Decisions of each episode: games that went alike are of one length."""
    rewards: list[list[tuple[int, float]]]
    """Of each episode: the decisions, from 0, that brought a reward, and which."""
    conditions: dict[str, Any]
    """Who was tested how: decisions of training, seed, fields of `EvaluationConfig`, how frames were played, and which
    episodes were cut."""


def evaluate(
    run: str | Path,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    policy: Policy = "agent",
    exploration: float | None = None,
    sticky_actions: float | None = None,
    variant: str | None = None,
    max_decisions: int | None = None,
    classes: ClassesMode | None = None,
    at: int | None = None,
    workers: int = 1,
    on_episode: Callable[[float, int], None] = lambda _total, _decisions: None,
    on_step: Callable[[int, Step], None] = lambda _episode, _step: None,
) -> EvaluationResult:
    """Play a run greedily and write ``evaluation.json`` into its folder.

    Who plays, random and sticky actions, a variant and a milestone stand in the file's name: see `result_path`.
    Number and seed of the episodes do not, so the newest evaluation of a kind replaces the one before.

    Parameters
    ----------
    run
        Folder of the run; its newest checkpoint plays.
    episodes, exploration, sticky_actions, variant, max_decisions, classes
        As in `EvaluationConfig`; the run's own when None.
    seed
        Of the episodes; when None, one that training did not use.
    policy
        Who decides.
    at
        Decisions after which the run is tested: one of its milestones; as it is now when None.
    workers
        Processes that play, this one included; what comes out is the same. A script that asks for several must do so
        under ``if __name__ == "__main__":``, since others begin by importing it.
    on_episode
        Called with return and decisions of each episode, in their order.
    on_step
        Called with the number of the episode and every decision of those that this process plays, the first among
        them; for videos.

    Raises
    ------
    UsageError
        When there is no such run or milestone, its agent has not begun to learn, there is nothing to play, or a
        planner is asked for where there is no map.

    Examples
    --------
    With the run of the page *Start*, five balls an episode:

    >>> result = evaluate("runs/catch", episodes=2, policy="planner")
    >>> result.episodes, result.lengths
    (2, [45, 45])
    """
    if (episodes is not None and episodes < 1) or (seed is not None and seed < 0):
        raise UsageError(f"episodes must be 1 or more and seed 0 or more, not {episodes} and {seed}")
    if workers < 1:
        raise UsageError(f"workers must be 1 or more, not {workers}")
    named: dict[str, Any] = {"exploration": exploration, "sticky_actions": sticky_actions, "variant": variant}
    named |= {"classes": classes}
    asked = {**named, "episodes": episodes, "max_decisions": max_decisions}
    conditions = {name: value for name, value in asked.items() if value is not None}
    player = ready_player(run, policy, at, conditions)
    path = result_path(run, policy=policy, at=at, **named)
    warn_unwritable(path)
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    games = Asked(run=str(run), policy=policy, at=at, conditions=tuple(conditions.items()), seed=seed)
    result = _played(games, player, workers=workers, on_episode=on_episode, on_step=on_step)
    keep_result(path, asdict(result))
    return result


def _played(
    asked: Asked,
    player: Player,
    *,
    workers: int,
    on_episode: Callable[[float, int], None],
    on_step: Callable[[int, Step], None],
) -> EvaluationResult:
    """Play the episodes of an evaluation; see `evaluate`."""
    workers = 1 if player.classes else workers  # what they changed is counted here
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        games = play_games(asked, player, env, workers=workers, on_episode=on_episode, on_step=on_step)
        world = World.of(env, player.config.environment)
    return _summed_up(asked.run, asked.policy, games, _conditions(player, asked.seed, world, games))


def _conditions(player: Player, seed: int, world: World, games: Sequence[PlayedGame]) -> dict[str, Any]:
    """Return who was tested how, and warn of episodes that were cut."""
    cut = [number for number, game in enumerate(games) if game.is_cut]
    if cut:
        _warn_of_cuts(cut, player.config.evaluation)
    tested = {"decisions": player.decisions, "seed": seed, **asdict(player.config.evaluation)}
    played: dict[str, Any] = {
        "frame_skip": world.frame_skip,
        "max_frames": world.max_frames,
        "pooling": world.pooling,
        "sticky_actions": world.sticky_actions,
    }
    played |= {"variant": player.variant}
    if player.classes:
        played |= {"changed": player.classes.changed / max(player.classes.decisions, 1)}
    return {**tested, **played, "cut": cut}


def _warn_of_cuts(cut: Sequence[int], tested: EvaluationConfig) -> None:
    which = f"{len(cut)} of {tested.episodes} episodes were" if len(cut) > 1 else f"episode {cut[0]} was"
    warnings.warn(
        f"{which} cut after {tested.max_decisions:,} decisions, before the game had ended; "
        "--max-decisions says how long an episode may be",
        SemrlWarning,
        stacklevel=4,
    )


def result_path(
    run: str | Path,
    *,
    policy: Policy = "agent",
    exploration: float | None = None,
    sticky_actions: float | None = None,
    variant: str | None = None,
    classes: ClassesMode | None = None,
    at: int | None = None,
) -> Path:
    """Return where `evaluate` writes: ``evaluation.json``, or ``evaluation-planner-sticky-0.25-at-50000.json``."""
    shares = {"random": exploration, "sticky": sticky_actions}
    parts: list[str] = [] if policy == "agent" else [policy]
    parts += [f"{name}-{share:g}" for name, share in shares.items() if share is not None]
    parts += [] if variant is None else [variant or "unaltered"]
    parts += [] if classes is None else [f"classes-{classes}"]
    parts += [] if at is None else [f"at-{at}"]
    return Path(run) / f"{'-'.join(['evaluation', *parts])}.json"


def _summed_up(
    run: str | Path, policy: Policy, games: Sequence[PlayedGame], conditions: dict[str, Any]
) -> EvaluationResult:
    returns = [game.total for game in games]
    return EvaluationResult(
        run=str(run),
        policy=policy,
        episodes=len(returns),
        mean=float(np.mean(returns)),
        std=float(np.std(returns, ddof=1)) if len(returns) > 1 else 0.0,
        min=min(returns),
        max=max(returns),
        returns=returns,
        lengths=[game.decisions for game in games],
        rewards=[game.rewards for game in games],
        conditions=conditions,
    )
