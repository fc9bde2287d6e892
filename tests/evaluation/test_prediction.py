"""What a model predicts of new play is counted as it should be (§4.2)."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from sklearn.metrics import balanced_accuracy_score, r2_score

from semrl.core.errors import UsageError
from semrl.evaluation import load_player
from semrl.evaluation.prediction import _explained, balanced_accuracy, world_model_accuracy
from semrl.evaluation.scores import EVALUATION_SEED, PROBING
from semrl.training import RunFolder, train


def test_it_is_what_scikit_learn_says_of_the_same_play(map_run):
    told = world_model_accuracy(map_run, decisions=60)
    player = load_player(map_run).under(exploration=PROBING)
    came, predicted, rewards, guesses = [], [], [], []
    for number, length in enumerate((45, 15)):  # five balls of nine decisions, and what is left of 60
        steps = list(player.episode(number, player.config.seed + EVALUATION_SEED))[: length + 1]
        for before, after in pairwise(steps):
            scenario = player.planning.world_model.imagine(before.record.history, np.array([[after.action]]))
            came.append(after.state.facts)
            predicted.append(scenario.states[0, 0])
            rewards.append(int(np.sign(after.total - before.total)))
            guesses.append(int(scenario.rewards[0, 0]))
    assert told.decisions == len(came) == 60
    assert told.explained[1] == pytest.approx(r2_score(came, predicted, multioutput="variance_weighted"), abs=1e-6)
    assert told.balanced_accuracy == pytest.approx(balanced_accuracy_score(rewards, guesses))
    assert np.sum(told.confusion) == 60 and np.sum(told.confusion, axis=1)[1] == rewards.count(0)
    assert set(told.explained) <= {1, 2, 5, 10, 20} and told.explained[5] <= 1
    assert told.explained_vectors == {}  # they are what is predicted


def test_where_objects_are_foreseen_so_are_the_vectors_of_their_scenes(tracked_run):
    told, player = world_model_accuracy(tracked_run, decisions=60), load_player(tracked_run).under(exploration=PROBING)
    came, predicted = [], []
    for number, length in enumerate((45, 15)):
        steps = list(player.episode(number, player.config.seed + EVALUATION_SEED))[: length + 1]
        for before, after in pairwise(steps):
            scenario = player.planning.world_model.imagine(before.record.history, np.array([[after.action]]))
            came.append(after.state.vector[: player.encoder.perception.embedder.dimension])
            predicted.append(player.encoder.embed(scenario.states[0, 0]))
    assert told.explained_vectors[1] == pytest.approx(
        r2_score(came, predicted, multioutput="variance_weighted"), abs=1e-6
    )
    assert told.explained_vectors.keys() == told.explained.keys()


def test_a_milestone_foresees_as_it_did_then(tmp_path, tracked_run):
    config = RunFolder.open(tracked_run).config()
    run = tmp_path / "run"
    train(run, replace(config, milestones=(200,)))
    now, then = world_model_accuracy(run, decisions=60), world_model_accuracy(run, decisions=60, at=200)
    assert {path.name for path in run.glob("predictions*")} == {"predictions.json", "predictions-at-200.json"}
    assert json.loads((run / "predictions-at-200.json").read_text())["conditions"]["learned_from"] == 200
    assert now != then
    with pytest.raises(UsageError, match="has no milestone of decision 100"):
        world_model_accuracy(run, at=100)


@pytest.mark.parametrize("decisions", [1, 7, 45, 46, 100])
def test_what_was_asked_for_is_played(map_run, decisions):
    steps = []
    told = world_model_accuracy(map_run, decisions=decisions, on_step=steps.append)
    assert told.decisions == np.sum(told.confusion) == decisions
    assert sum(step.action is not None for step in steps) == decisions


def test_kinds_that_never_came_do_not_count():
    assert balanced_accuracy(np.array([[0, 0, 0], [2, 6, 0], [0, 1, 1]])) == pytest.approx((0.75 + 0.5) / 2)


def test_states_that_never_vary_have_no_share():
    """An object that no frame showed, say: JSON knows no NaN."""
    still, moving = np.zeros(3, np.float32), np.arange(3, dtype=np.float32)
    assert _explained({1: [(still, still)] * 4, 2: [(moving, moving), (still, still)], 5: []}) == {2: 1.0}


def test_without_a_map_nothing_is_foreseen(semantic_run, map_run):
    with pytest.raises(UsageError, match="has no map"):
        world_model_accuracy(semantic_run)
    with pytest.raises(UsageError, match="decisions must be 1 or more"):
        world_model_accuracy(map_run, decisions=0)
