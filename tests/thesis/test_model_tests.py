from dataclasses import replace

import numpy as np
import pytest

from semrl.core import Scenarios, Trajectory
from semrl.planning.config import PlanningConfig
from semrl.planning.module import PlanningModule
from semrl.world_model import ModelPair, ModelPairConfig, NextStateConfig, TreesConfig
from semrl_thesis.prediction import confusion, examine, predict_run, r2, shares

RNG = np.random.default_rng(0)


def walk(length=200):
    """A point that goes where it is told; a reward of its sign whenever it is far out."""
    actions = RNG.integers(0, 2, length)
    places = np.zeros(length + 1, np.float32)
    for i, action in enumerate(actions):
        places[i + 1] = np.clip(places[i] + 0.25 * (2 * action - 1), -1, 1)
    rewards = np.sign(places[1:]) * (np.abs(places[1:]) >= 1)
    return Trajectory(states=np.stack([places, -places], axis=1), actions=actions, rewards=rewards.astype(np.float32))


def test_r2_of_what_is_exact_and_of_the_mean():
    came = walk().states[1:]
    assert r2(came, came) == 100
    assert r2(came, np.broadcast_to(came.mean(axis=0), came.shape)) == pytest.approx(0)


def test_r2_where_nothing_varies():
    still = np.ones((5, 2), np.float32)
    assert (r2(still, still), r2(still, 2 * still)) == (100, 0)


def test_confusion():
    run = walk()
    said = RNG.integers(-1, 2, len(run))
    truth = np.sign(run.rewards).astype(int)
    assert set(truth) == {-1, 0, 1}
    counts = confusion(run.rewards, said)
    assert counts.sum() == len(run)
    assert shares(counts)[0, 2] == np.mean(said[truth == -1] == 1)
    np.testing.assert_array_equal(shares(confusion(run.rewards, truth)), np.eye(3))
    assert shares(confusion(np.zeros(3), np.zeros(3, int))).tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 0]]


class Recalls(ModelPair):
    """A world that predicts the last state again, and notes where it was asked."""

    def imagine(self, history, sequences):
        self.asked = [*getattr(self, "asked", []), (history, int(sequences[0, 0]))]
        return Scenarios(
            actions=sequences,
            states=history.states[None, :1],
            rewards=np.ones((1, 1), np.float32),
            values=np.zeros(1, np.float32),
        )


def test_every_decision_is_predicted_from_what_had_led_to_it():
    run, world = walk(30), Recalls(ModelPairConfig(), 2, 2)
    states, rewards = predict_run(world, run)
    np.testing.assert_array_equal(states, run.states[:-1])
    assert rewards.tolist() == [1] * 30
    history, action = world.asked[20]
    assert (history.number, action) == (20, run.actions[20])
    np.testing.assert_array_equal(history.states, run.states[20:4:-1])
    np.testing.assert_array_equal(history.actions, run.actions[19:4:-1])


def test_of_updated_forests_each_has_learned_the_new_run():
    trees = TreesConfig(members=4, first_decisions=50, resolution=0.25)
    planning = PlanningModule(PlanningConfig(world_model="trees", trees=trees), 2, 2, seed=0)
    planning.learn(walk(400))
    turned = walk(400)
    turned = replace(turned, actions=1 - turned.actions)
    next_states, _, _ = examine(planning, turned)
    assert next_states["updated"] > next_states["trained"] + 1


@pytest.mark.parametrize("kind", ["trees", "networks"])
def test_worlds_are_tested_in_every_way_and_stay_as_they_were(kind):
    network = NextStateConfig(epochs=10, hidden_units=(32,), learning_rate=1e-2, adam_beta1=0.9)
    config = PlanningConfig(
        world_model=kind,
        networks=ModelPairConfig(next_state=network),
        trees=TreesConfig(first_decisions=50, resolution=0.25),
    )
    planning = PlanningModule(config, 2, 2, seed=0)
    planning.learn(walk(400))
    run = walk(300)
    before = predict_run(planning.world_model, run)
    next_states, rewards, matrices = examine(planning, run)
    np.testing.assert_array_equal(predict_run(planning.world_model, run)[0], before[0])
    further = {"folds", "scratch-128", "folds-128"} if kind == "networks" else set()
    assert set(next_states) == {"trained", "updated", "scratch"} | further
    assert min(next_states.values()) > 80
    assert set(rewards) == {"trained", "updated", "scratch"} | (further & {"folds"})
    assert set(matrices) == {"trained", "updated", "scratch"}
    assert rewards["trained"] == pytest.approx(100 * np.diag(matrices["trained"]).mean())
