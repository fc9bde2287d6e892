"""How well a trained run plays: returns of greedy games from random starts."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from semrl.errors import UsageError
from semrl.runs.files import write_text
from semrl.runs.player import Policy, Step, load_player
from semrl.runs.session import limited_threads

EVALUATION_SEED = 1_000_000
"""Added to a run's seed for its evaluation."""

PROBING = 0.01
"""Probability of a random action where foresight is tested: a game that is always played alike tells little."""


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


def evaluate(
    run: str | Path,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    policy: Policy = "agent",
    exploration: float | None = None,
    sticky_actions: float | None = None,
    at: int | None = None,
    on_episode: Callable[[float], None] = lambda _: None,
    on_step: Callable[[int, Step], None] = lambda _episode, _step: None,
) -> EvaluationResult:
    """Play a run greedily and write ``evaluation.json`` into its folder.

    Who plays, random and sticky actions, and a milestone stand in the file's name: see `result_path`. Number and seed
    of the episodes do not, so the newest evaluation of a kind replaces the one before.

    Parameters
    ----------
    run
        Folder of the run; its newest checkpoint plays.
    episodes, exploration, sticky_actions
        As in `EvaluationConfig`; the run's own when None.
    seed
        Of the episodes; when None, one that training did not use.
    policy
        Who decides.
    at
        Decisions after which the run is tested: one of its milestones; as it is now when None.
    on_episode
        Is told the return of each episode.
    on_step
        Is told the number of the episode and every decision; for videos.

    Raises
    ------
    UsageError
        When there is no such run or milestone, its agent has not begun to learn, there is nothing to play, or a
        planner is asked for where there is no map.
    """
    if (episodes is not None and episodes < 1) or (seed is not None and seed < 0):
        raise UsageError(f"episodes must be 1 or more and seed 0 or more, not {episodes} and {seed}")
    asked = {"episodes": episodes, "exploration": exploration, "sticky_actions": sticky_actions}
    player = load_player(run, at).under(**{name: value for name, value in asked.items() if value is not None})
    if player.perceiving:
        raise UsageError(f"{run} has not learned to see yet, so there is no agent to play with: it needs more frames")
    if policy == "planner":
        player.require_foresight(run)
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    games: list[tuple[float, int]] = []
    with limited_threads(player.config.threads):
        for episode in range(player.config.evaluation.episodes):
            games.append(_game(player.episode(episode, seed, policy), partial(on_step, episode)))
            on_episode(games[-1][0])
    result = _summed_up(run, policy, games)
    provenance = {"decisions": player.decisions, "seed": seed, **asdict(player.config.evaluation)}
    path = result_path(run, policy=policy, exploration=exploration, sticky_actions=sticky_actions, at=at)
    write_text(path, json.dumps(asdict(result) | {"with": provenance}, indent=2) + "\n")
    return result


def _game(steps: Iterator[Step], on_step: Callable[[Step], None]) -> tuple[float, int]:
    """Play an episode to its end; return its return and its decisions."""
    decisions = -1  # the first step is the beginning
    for step in steps:
        decisions += 1
        on_step(step)
    return step.total, decisions


def result_path(
    run: str | Path,
    *,
    policy: Policy = "agent",
    exploration: float | None = None,
    sticky_actions: float | None = None,
    at: int | None = None,
) -> Path:
    """Return where `evaluate` writes: ``evaluation.json``, or ``evaluation-planner-sticky-0.25-at-50000.json``."""
    shares = {"random": exploration, "sticky": sticky_actions}
    parts: list[str] = [] if policy == "agent" else [policy]
    parts += [f"{name}-{share:g}" for name, share in shares.items() if share is not None]
    parts += [] if at is None else [f"at-{at}"]
    return Path(run) / f"{'-'.join(['evaluation', *parts])}.json"


def _summed_up(run: str | Path, policy: Policy, games: Sequence[tuple[float, int]]) -> EvaluationResult:
    returns = [total for total, _ in games]
    return EvaluationResult(
        run=str(run),
        policy=policy,
        episodes=len(returns),
        mean=float(np.mean(returns)),
        std=float(np.std(returns, ddof=1)) if len(returns) > 1 else 0.0,
        min=min(returns),
        max=max(returns),
        returns=returns,
        lengths=[decisions for _, decisions in games],
    )
