"""How well the models of the lower line foresee a run (§4.2): as trained, from scratch, in folds, updated."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import confusion_matrix, r2_score
from sklearn.model_selection import KFold, StratifiedKFold

from semrl.ontology import NextStateConfig, RewardConfig, make_next_state_model, make_reward_model
from semrl.protocols import DynamicsModel, RewardModel
from semrl.reasoning import Reasoner
from semrl.types import Trajectory, Transitions

FOLDS = 5
FEWER_UNITS = 128
"""Neurons of the smaller network (§4.2.1)."""

SIGNS = (-1, 0, 1)

Matrix = NDArray[np.float64]


def next_state_scores(reasoner: Reasoner, run: Trajectory) -> dict[str, float | None]:
    """Return R² in percent of the next-state model on a run, in all the ways of §4.2.

    ``trained``: as it is; ``updated``: after learning the run as well; ``scratch``: a new model that learned the run;
    ``folds``: the best of five, each tested on a fifth that it did not see; and the last two for fewer neurons, where
    the model is a network.
    """
    config, told = reasoner.config.next_state, reasoner.told(run).transitions

    def score(model: DynamicsModel, on: Transitions) -> float:
        return r2(model, on, reasoner.dimension)

    def make(config: NextStateConfig) -> DynamicsModel:
        return make_next_state_model(config, told.states.shape[1], reasoner.n_actions)

    folds = list(KFold(min(FOLDS, len(told))).split(np.arange(len(told))))
    updated = make(config)
    updated.from_arrays(reasoner.next_state.to_arrays())
    scores = {
        "trained": score(reasoner.next_state, told),
        "updated": score(_fitted(updated, config, told), told),
        **_anew(lambda: make(config), config, told, folds, score),
    }
    if config.kind == "network":
        smaller = replace(config, hidden_units=(FEWER_UNITS,))
        anew = _anew(lambda: make(smaller), smaller, told, folds, score)
        scores |= {f"{name}-{FEWER_UNITS}": value for name, value in anew.items()}
    return {name: 100 * value for name, value in scores.items()}


def reward_scores(reasoner: Reasoner, run: Trajectory) -> tuple[dict[str, float | None], dict[str, Matrix]]:
    """Return balanced accuracy in percent of the reward model on a run, as `next_state_scores`, and confusion matrices.

    The matrices are those of ``trained``, ``updated`` and ``scratch``, ``(3, 3)``: a row for each sign of −1, 0, 1,
    shares that sum to 1; zeros for a sign that the run does not have.
    """
    config, told = reasoner.config.reward, reasoner.told(run).transitions

    def make() -> RewardModel:
        return make_reward_model(config, told.states.shape[1], reasoner.n_actions)

    updated = make()
    updated.from_arrays(reasoner.reward.to_arrays())
    models = {
        "trained": reasoner.reward,
        "updated": _fitted(updated, config, told),
        "scratch": _fitted(make(), config, told),
    }
    matrices = {name: confusion(model, told) for name, model in models.items()}
    scores: dict[str, float] = {name: balanced_accuracy(model, told) for name, model in models.items()}
    signs = np.sign(told.rewards).astype(int)
    rarest = np.unique(signs, return_counts=True)[1].min()
    if min(rarest, len(told)) >= 2 and len(np.unique(signs)) > 1:
        folds = list(StratifiedKFold(min(FOLDS, int(rarest))).split(signs, signs))
        scores["folds"] = _best_fold(make, config, told, folds, balanced_accuracy)
    return {name: 100 * value for name, value in scores.items()}, matrices


def r2(model: DynamicsModel, on: Transitions, dimension: int) -> float:
    """Return R² of the predicted next states, the mean over the numbers of a state.

    Parameters
    ----------
    model
        Predicts.
    on
        What came; states may have past actions behind their first `dimension` numbers, which do not count.
    dimension
        Numbers of a state.
    """
    predicted = model.predict(on.states, on.previous, on.actions)
    return float(r2_score(on.next_states[:, :dimension], predicted[:, :dimension]))


def balanced_accuracy(model: RewardModel, on: Transitions) -> float:
    """Return the mean, over the signs that were met, of the share that was predicted, 0 … 1."""
    truth, predicted = np.sign(on.rewards).astype(int), model.predict(on.states, on.previous, on.actions)
    return float(np.mean([np.mean(predicted[truth == sign] == sign) for sign in np.unique(truth)]))


def confusion(model: RewardModel, on: Transitions) -> Matrix:
    """Return the confusion matrix, ``(3, 3)``, rows normalised; zeros for a sign that was not met."""
    truth, predicted = np.sign(on.rewards).astype(int), model.predict(on.states, on.previous, on.actions)
    counts = confusion_matrix(truth, predicted, labels=SIGNS)
    shares: Matrix = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    return shares


def _anew(
    make: Callable[[], Any], config: Any, told: Transitions, folds: Any, score: Callable[[Any, Transitions], float]
) -> dict[str, float]:
    """Score new models: one that learned the run, and the best of those that missed a part, on that part."""
    return {
        "scratch": score(_fitted(make(), config, told), told),
        "folds": _best_fold(make, config, told, folds, score),
    }


def _best_fold(
    make: Callable[[], Any], config: Any, told: Transitions, folds: Any, score: Callable[[Any, Transitions], float]
) -> float:
    return max(score(_fitted(make(), config, told.take(seen)), told.take(kept)) for seen, kept in folds)


def _fitted(model: Any, config: NextStateConfig | RewardConfig, transitions: Transitions) -> Any:
    """Let a model learn as it does after an episode."""
    for _ in range(1 if config.kind == "trees" else config.epochs):
        model.partial_fit(transitions)
    return model
