"""How well a run's model of the world predicts play that it has not seen (§4.2)."""

import contextlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.errors import UsageError
from semrl.evaluation.kept import keep_result, warn_unwritable
from semrl.evaluation.player import Policy, load_player
from semrl.evaluation.scores import EVALUATION_SEED, PROBING
from semrl.perception.encoders.tracked_scene import TrackedSceneEncoder
from semrl.training.loop import Step
from semrl.training.session import limited_threads
from semrl.world_model.protocol import WorldModel

HORIZONS = (1, 2, 5, 10, 20)

FILE = "predictions.json"
"""Where it is written, in the folder of a run; of a milestone, into ``predictions-at-DECISIONS.json``."""

Spans = dict[int, list[tuple[Floats, Floats]]]
"""Horizon → states predicted and states that came."""


@dataclass(frozen=True, kw_only=True)
class Quality:
    """What a model of the world is worth."""

    decisions: int
    """That were predicted."""
    explained: dict[int, float]
    """Horizon in decisions → share of the variance of the states that is explained (R², weighted by variance)."""
    explained_vectors: dict[int, float]
    """The same for the vector of the scene, where objects are predicted and the scene follows from them; else empty."""
    confusion: list[list[int]]
    """``(3, 3)`` counts, what came in rows, what was predicted in columns: a loss, nothing, a gain."""
    balanced_accuracy: float
    """Mean share of each kind that was predicted, over those that came."""
    conditions: dict[str, Any]
    """Decisions that the model learned from, and how the episodes were played."""


def world_model_accuracy(
    run: str | Path,
    *,
    decisions: int = 10_000,
    seed: int | None = None,
    policy: Policy = "agent",
    at: int | None = None,
    on_step: Callable[[Step], None] = lambda _: None,
) -> Quality:
    """Play new episodes, compare what came with what the run's model predicted, and write it into the run's folder.

    A span of several decisions counts when no reward falls into it, since the model stops at a reward.

    Parameters
    ----------
    run
        Folder of a run with a map.
    decisions
        So many are played, of as many episodes as that takes; the last one is left when they are over.
    seed
        Of the episodes; when None, one that training did not use.
    policy
        Who plays.
    at
        Decisions after which the model is tested: one of the run's milestones; as it is now when None.
    on_step
        Called at every decision.

    Raises
    ------
    UsageError
        When there is no such run or milestone, or nothing that could predict.
    """
    if decisions < 1 or (seed is not None and seed < 0):
        raise UsageError(f"decisions must be 1 or more and seed 0 or more, not {decisions} and {seed}")
    player = load_player(run, at).under(exploration=PROBING)
    world = player.require_predictions(run).world_model
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    path = Path(run) / (FILE if at is None else f"predictions-at-{at}.json")
    warn_unwritable(path)
    facts: Spans = {horizon: [] for horizon in HORIZONS}
    confusion = np.zeros((3, 3), np.int64)
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        for steps in played(partial(player.episode, seed=seed, policy=policy, env=env), decisions, on_step):
            _compare(world, steps, facts, confusion)
        vectors: Spans = _embedded(player.encoder, facts) if isinstance(player.encoder, TrackedSceneEncoder) else {}
    conditions = {"learned_from": player.decisions, "seed": seed, "policy": policy, "exploration": PROBING}
    quality = Quality(
        decisions=int(confusion.sum()),
        explained=_explained(facts),
        explained_vectors=_explained(vectors),
        confusion=confusion.tolist(),
        balanced_accuracy=balanced_accuracy(confusion),
        conditions=conditions,
    )
    keep_result(path, asdict(quality), indent=2)
    return quality


def balanced_accuracy(confusion: NDArray[np.int64]) -> float:
    """Return the mean share that was predicted of each kind that came, from ``(k, k)`` counts."""
    came = confusion.sum(axis=1)
    return float((confusion.diagonal()[came > 0] / came[came > 0]).mean())


def played(
    play: Callable[[int], Iterator[Step]], decisions: int, on_step: Callable[[Step], None]
) -> Iterator[Sequence[Step]]:
    """Play so many decisions; yield the steps of each episode."""
    number = 0
    while decisions > 0:
        steps = []
        for step in itertools.islice(play(number), decisions + 1):  # and the first observation
            steps.append(step)
            on_step(step)
        decisions, number = decisions - len(steps) + 1, number + 1
        yield steps


def _compare(world: WorldModel, steps: Sequence[Step], spans: Spans, confusion: NDArray[np.int64]) -> None:
    """Predict every decision of an episode, and what is some decisions ahead of it."""
    histories = [step.record.history for step in steps if step.record]
    actions = np.array([step.action for step in steps[1:]])
    rewards = np.sign([step.training_reward for step in steps[1:]]).astype(int)
    longest = max(HORIZONS)
    for t, history in enumerate(histories[:-1]):
        imagined = world.imagine(history, actions[None, t : t + longest])
        confusion[rewards[t] + 1, int(np.rint(imagined.rewards[0, 0])) + 1] += 1
        for horizon in HORIZONS:
            if t + horizon < len(histories) and (horizon == 1 or not rewards[t : t + horizon].any()):
                spans[horizon].append((imagined.states[0, horizon - 1], histories[t + horizon].states[0]))


def _embedded(encoder: TrackedSceneEncoder, facts: Spans) -> Spans:
    """Return the vectors of the scenes that were predicted and that came."""
    return {
        horizon: [(encoder.embed(predicted), encoder.embed(came)) for predicted, came in pairs]
        for horizon, pairs in facts.items()
    }


def _explained(spans: Spans) -> dict[int, float]:
    """Return R² of each horizon; nothing for one at which the states never varied."""
    shares = {}
    for horizon, pairs in spans.items():
        if pairs:
            predicted, came = (np.array(part, np.float64) for part in zip(*pairs, strict=True))
            variation = float(((came - came.mean(axis=0)) ** 2).sum())
            if variation:
                shares[horizon] = 1 - float(((came - predicted) ** 2).sum()) / variation
    return shares
