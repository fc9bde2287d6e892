import numpy as np
import pytest
from sklearn.metrics import balanced_accuracy_score

from semrl.experiments.foresight import balanced_accuracy, confusion, next_state_scores, r2, reward_scores
from semrl.ontology import NextStateConfig, RewardConfig
from semrl.reasoning import Reasoner, ReasoningConfig
from semrl.types import Trajectory

RNG = np.random.default_rng(0)


def walk(length=200):
    """A point that goes where it is told; a reward of its sign whenever it is far out."""
    actions = RNG.integers(0, 2, length)
    places = np.zeros(length + 1, np.float32)
    for i, action in enumerate(actions):
        places[i + 1] = np.clip(places[i] + 0.25 * (2 * action - 1), -1, 1)
    rewards = np.sign(places[1:]) * (np.abs(places[1:]) >= 1)
    return Trajectory(states=np.stack([places, -places], axis=1), actions=actions, rewards=rewards.astype(np.float32))


class Told:
    """A model that says what it is given."""

    def __init__(self, said):
        self.said = said

    def predict(self, states, previous, actions):
        return self.said


def test_r2_of_what_is_exact_and_of_the_mean():
    run = walk().transitions
    assert r2(Told(run.next_states), run, 2) == 1
    assert r2(Told(np.broadcast_to(run.next_states.mean(axis=0), run.next_states.shape)), run, 2) == pytest.approx(0)
    other = np.concatenate([run.next_states[:, :1], RNG.normal(size=(len(run), 1))], axis=1)
    assert r2(Told(other), run, 1) == 1  # numbers behind the state do not count


def test_accuracy_and_confusion():
    run = walk().transitions
    said = RNG.integers(-1, 2, len(run))
    truth = np.sign(run.rewards).astype(int)
    assert set(truth) == {-1, 0, 1}
    assert balanced_accuracy(Told(said), run) == pytest.approx(balanced_accuracy_score(truth, said))
    matrix = confusion(Told(said), run)
    np.testing.assert_allclose(matrix.sum(axis=1), 1)
    assert matrix[0, 2] == np.mean(said[truth == -1] == 1)
    np.testing.assert_array_equal(confusion(Told(truth), run), np.eye(3))


def test_a_sign_that_was_not_met_has_an_empty_row():
    run = walk(3).transitions
    matrix = confusion(Told(np.zeros(3, int)), run)
    assert matrix.tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 0]]


@pytest.mark.parametrize("kind", ["trees", "network"])
def test_models_are_tested_in_every_way_and_stay_as_they_were(kind):
    next_state = NextStateConfig(kind=kind, epochs=10, hidden_units=(32,), learning_rate=1e-2, adam_beta1=0.9)
    reward = RewardConfig(kind="trees" if kind == "trees" else "svm")
    reasoner = Reasoner(ReasoningConfig(next_state=next_state, reward=reward, past_actions=1), 2, 2, seed=0)
    reasoner.learn(walk(400))
    run = walk(300)
    asked = reasoner.told(run).transitions
    before = reasoner.next_state.predict(asked.states, asked.previous, asked.actions)
    foreseen, (rewards, matrices) = next_state_scores(reasoner, run), reward_scores(reasoner, run)
    np.testing.assert_array_equal(reasoner.next_state.predict(asked.states, asked.previous, asked.actions), before)
    smaller = {"scratch-128", "folds-128"} if kind == "network" else set()
    assert set(foreseen) == {"trained", "updated", "scratch", "folds"} | smaller
    assert min(value for value in foreseen.values() if value is not None) > 80
    assert set(rewards) == {"trained", "updated", "scratch", "folds"}
    assert set(matrices) == {"trained", "updated", "scratch"}
    assert rewards["trained"] == pytest.approx(100 * np.diag(matrices["trained"]).mean())
