"""How well the lower line predicts a run (§4.2): as trained, updated, from scratch, in folds."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import r2_score
from sklearn.model_selection import KFold, StratifiedKFold

from semrl.core import Floats, History, Ints, Trajectory, Transitions
from semrl.evaluation.prediction import balanced_accuracy
from semrl.planning.config import MEMORY_DECISIONS
from semrl.planning.module import PlanningModule
from semrl.world_model import ModelPair, NextStateConfig, NextStateNetwork, RewardConfig, TreeWorld, make_reward_model
from semrl.world_model.protocol import WorldModel

FOLDS = 5
FEWER_UNITS = 128
"""Neurons of the smaller network (§4.2.1)."""

SIGNS = (-1, 0, 1)

Scores = dict[str, float | None]


def worlds(planning: PlanningModule, run: Trajectory) -> dict[str, WorldModel]:
    """Return models of the world to be tested on a run: ``trained``, ``updated`` with it, from ``scratch`` with it.

    The planning module is one that was loaded with its memory.
    """
    config, shape = planning.config, (planning.dimension, planning.n_actions)

    def new(**changes: Any) -> WorldModel:
        return PlanningModule(replace(config, **changes), *shape, seed=0, axes=planning.axes).world_model

    updated, scratch = _to_be_updated(planning.world_model, new(trees=replace(config.trees, first_decisions=1))), new()
    models = {"trained": planning.world_model, "updated": updated, "scratch": scratch}
    if isinstance(scratch, ModelPair):
        fewer = replace(config.networks.next_state, hidden_units=(FEWER_UNITS,))
        models[f"scratch-{FEWER_UNITS}"] = new(networks=replace(config.networks, next_state=fewer))
    for name in models.keys() - {"trained"}:
        models[name].partial_fit(run)
    return {name: world for name, world in models.items() if world.is_fitted}


def _to_be_updated(trained: WorldModel, updated: WorldModel) -> WorldModel:
    """Let a new model know what a trained one does; of forests, which learn one at a time, only what they remember."""
    if isinstance(updated, TreeWorld) and isinstance(trained, TreeWorld):
        updated.experience.from_arrays(trained.experience.to_arrays())
    else:
        updated.from_arrays(trained.to_arrays())
    return updated


def predict_run(world: WorldModel, run: Trajectory) -> tuple[Floats, Ints]:
    """Predict every decision of a run on its own: states it leads to, ``(t, d)``, and signs of rewards, ``(t,)``."""
    states, rewards = np.empty_like(run.states[1:]), np.zeros(len(run), np.int64)
    for t in range(len(run)):
        start = max(0, t + 1 - MEMORY_DECISIONS)
        history = History(states=run.states[start : t + 1][::-1], actions=run.actions[start:t][::-1], number=t)
        imagined = world.imagine(history, run.actions[None, t : t + 1])
        states[t], rewards[t] = imagined.states[0, 0], np.rint(imagined.rewards[0, 0])
    return states, rewards


def r2(came: Floats, predicted: Floats) -> float:
    """Return R² of next states in percent, the mean over the numbers of a state that were not always the same.

    Where none varied, it is 100 if all was predicted exactly and 0 otherwise, as scikit-learn has it.
    """
    varying = np.ptp(came, axis=0) > 0
    varying |= not varying.any()
    return 100 * float(r2_score(came[:, varying], predicted[:, varying]))


def confusion(rewards: Floats, predicted: Ints) -> NDArray[np.int64]:
    """Return counts, ``(3, 3)``: what the sign was in rows, what was predicted in columns, −1, 0 and 1."""
    counts = np.zeros((3, 3), np.int64)
    np.add.at(counts, (np.sign(rewards).astype(int) + 1, predicted + 1), 1)
    return counts


def shares(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return a confusion matrix with rows that sum to 1; zeros for a sign that was not met."""
    return np.asarray(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1))


def examine(planning: PlanningModule, run: Trajectory) -> tuple[Scores, Scores, Mapping[str, NDArray[np.float64]]]:
    """Test the model of the world on a run in all the ways of §4.2.

    Returns
    -------
    next_states
        R² in percent of each of `worlds`, and for the thesis's models of the best of five ``folds``, with fewer
        neurons as well.
    rewards
        Balanced accuracy in percent, likewise.
    matrices
        Confusion matrices of ``trained``, ``updated`` and ``scratch``.
    """
    next_states: Scores = {}
    rewards: Scores = {}
    matrices = {}
    for name, world in worlds(planning, run).items():
        predicted, signs = predict_run(world, run)
        next_states[name] = r2(run.states[1:], predicted)
        if name != f"scratch-{FEWER_UNITS}":
            counts = confusion(run.rewards, signs)
            rewards[name], matrices[name] = 100 * balanced_accuracy(counts), shares(counts)
    if isinstance(planning.world_model, ModelPair):
        next_states |= _next_state_folds(planning, run.transitions)
        rewards |= _reward_folds(planning, run.transitions)
    return next_states, rewards, matrices


def _next_state_folds(planning: PlanningModule, run: Transitions) -> Scores:
    """Return the best of five stretches, each predicted by a network that learned the others."""
    given = planning.config.networks.next_state
    folds = list(KFold(min(FOLDS, len(run))).split(np.arange(len(run))))

    def best(config: NextStateConfig) -> float:
        return _best_fold(
            partial(NextStateNetwork, config, planning.dimension, planning.n_actions),
            config,
            run,
            folds,
            lambda model, on: r2(on.next_states, model.predict(on.states, on.previous, on.actions)),
        )

    return {"folds": best(given), f"folds-{FEWER_UNITS}": best(replace(given, hidden_units=(FEWER_UNITS,)))}


def _reward_folds(planning: PlanningModule, run: Transitions) -> Scores:
    """Return the best of five folds that keep the share of each sign; none where a sign was met but once."""
    config = planning.config.networks.reward
    signs = np.sign(run.rewards).astype(int)
    kinds, counts = np.unique(signs, return_counts=True)
    if len(kinds) < 2 or counts.min() < 2:
        return {}

    def score(model: Any, on: Transitions) -> float:
        return 100 * balanced_accuracy(confusion(on.rewards, model.predict(on.states, on.previous, on.actions)))

    folds = StratifiedKFold(min(FOLDS, int(counts.min()))).split(signs, signs)
    make = partial(make_reward_model, config, planning.dimension, planning.n_actions)
    return {"folds": _best_fold(make, config, run, list(folds), score)}


def _best_fold(
    make: Callable[[], Any],
    config: NextStateConfig | RewardConfig,
    run: Transitions,
    folds: list[tuple[Ints, Ints]],
    score: Callable[[Any, Transitions], float],
) -> float:
    scores = []
    for seen, kept in folds:
        model = make()
        for _ in range(config.epochs):
            model.partial_fit(run.take(seen))
        scores.append(score(model, run.take(kept)))
    return max(scores)
