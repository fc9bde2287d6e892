"""What the actions move is told from what moves by chance."""

import numpy as np
import pytest

from semrl.perception.tracking.controllability import Controllability


def shares(actions, steps_px):
    influence = Controllability()
    for action, step in zip(actions, steps_px, strict=True):
        influence.learn(int(action), np.array([0]), step[None])
    return influence.shares(1)[0]


@pytest.mark.parametrize("n_actions", [2, 6, 18])
@pytest.mark.parametrize("n", [10, 30, 300])
def test_few_steps_of_many_actions_are_no_influence(n, n_actions):
    """By chance the mean steps of 18 actions explain most of 30 steps; what counts is how much more they explain."""
    rng = np.random.default_rng(n)
    found = [shares(rng.integers(n_actions, size=n), rng.normal(size=(n, 2))) for _ in range(40)]
    assert np.mean(found) < 0.25 and min(found) >= 0


def test_what_obeys_is_found_after_few_steps_already():
    rng = np.random.default_rng(0)
    actions = rng.integers(6, size=40)
    obeying = np.stack([actions - 2.5, np.zeros(40)], axis=1) + rng.normal(scale=0.3, size=(40, 2))
    assert shares(actions, obeying) > 0.9
    assert shares(actions, np.zeros((40, 2))) == 0
