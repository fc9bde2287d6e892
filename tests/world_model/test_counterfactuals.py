"""What flies by itself is learned from what is near: far things change places, and no longer go together with it."""

import numpy as np
import pytest

from semrl.core import History, Trajectory
from semrl.world_model import TreesConfig, TreeWorld
from semrl.world_model.axes import things_of
from semrl.world_model.counterfactuals import FAR, rearranged
from semrl.world_model.experience import Experience

AXES = np.array([0, 1, -1] * 3)
UNIT = 0.01
BALL, FOLLOWER = 0, 1


def world(decisions, seed=0, *, rests=None):
    """A ball flies between walls; from afar something follows it, but rests before the ball is served anew.

    Something else wanders about. With `rests`, the follower always does, or never.
    """
    rng = np.random.default_rng(seed)
    ball, speed, follower, other = np.array([50, 50]), np.array([2, 3]), 50, 50
    states = []
    for t in range(decisions + 1):
        resting = t % 40 >= 35 if rests is None else rests
        states.append((*ball, 100, 5, follower, 100, 95, other, 100))
        if t % 40 == 39 and rests is None:
            ball, speed = np.array([50, rng.integers(20, 80)]), rng.choice([-1, 1], 2) * (2, 3)
        else:
            speed = np.where((ball + speed < 0) | (ball + speed > 100), -speed, speed)
            ball = ball + speed
        follower += 0 if resting else int(np.clip(ball[1] - follower, -2, 2))
        other = int(np.clip(other + rng.choice([-2, 2]), 0, 100))
    return Trajectory(
        states=np.array(states, np.float32) * np.float32(UNIT),
        actions=np.zeros(decisions, np.int64),
        rewards=np.zeros(decisions, np.float32),
    )


def learned(**settings):
    config = TreesConfig(members=2, resolution=UNIT, first_decisions=100, distances=True, **settings)
    model = TreeWorld(config, 9, axes=AXES)
    for seed in range(3):
        model.partial_fit(world(1000, seed))
    return model


@pytest.fixture(scope="module")
def plain():
    return learned()


@pytest.fixture(scope="module")
def local():
    return learned(counterfactuals_from=1)


def right(model, play):
    """Return in which share of the decisions the ball is predicted to fly as it does."""
    found = []
    for t in range(5, len(play)):
        history = History(states=play.states[t::-1], actions=play.actions[:t][::-1], number=t)
        predicted = model.imagine(history, play.actions[None, t : t + 1]).states[0, 0, :2]
        found.append(np.abs(predicted - play.states[t + 1, :2]).max() < UNIT)
    return np.mean(found)


def test_numbers_are_parted_by_things():
    assert things_of(AXES).tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert things_of(np.array([0, 1, 1])).tolist() == [0, 0, 0]


def test_what_is_far_changes_places_whole_and_what_is_near_stays():
    play = Experience(2000, 9)
    play.add(world(1000))
    windows, *_, following = play.windows(3, 1)
    states = np.concatenate([following[:, None], windows], axis=1)
    new = rearranged(states, AXES, np.random.default_rng(0))
    near = np.abs(states[:, 1, 0] - states[:, 1, 3]) <= FAR
    near &= np.abs(states[:, 1, 1] - states[:, 1, 4]) <= FAR
    assert near.sum() > 20
    np.testing.assert_array_equal(new[near][:, :, :6], states[near][:, :, :6])
    together = {row.tobytes() for row in states[:, :, 3:6]}
    assert {row.tobytes() for row in new[:, :, 3:6]} <= together
    assert (new[:, :, 3:6] != states[:, :, 3:6]).any(axis=(1, 2)).mean() > 0.3
    assert (new[:, 1, :2] != states[:, 1, :2]).any(axis=1).mean() > 0.1


def test_only_what_flies_by_itself_is_local(plain, local):
    assert local.features.local_.tolist() == [BALL] and not len(plain.features.local_)


def test_a_ball_flies_on_when_what_follows_it_rests(plain, local):
    resting = world(600, seed=9, rests=True)
    assert right(local, resting) > 0.9
    assert right(plain, resting) < 0.75
    moving = world(600, seed=9, rests=False)
    assert right(local, moving) > 0.9 and right(plain, moving) > 0.9


def test_the_follower_is_still_predicted_by_the_ball(plain, local):
    play = world(600, seed=9, rests=False)

    def errors(model):
        for t in range(5, 590):
            history = History(states=play.states[t::-1], actions=play.actions[:t][::-1], number=t)
            yield abs(model.imagine(history, play.actions[None, t : t + 1]).states[0, 0, 4] - play.states[t + 1, 4])

    assert np.mean(list(errors(local))) < 1.5 * np.mean(list(errors(plain))) + 1e-3


def test_it_goes_on_where_it_was_saved(local):
    other = TreeWorld(local.config, 9, axes=AXES)
    other.from_arrays(local.to_arrays())
    np.testing.assert_array_equal(other.features.local_, local.features.local_)
    other.partial_fit(world(300, 5)), local.partial_fit(world(300, 5))
    for name, array in local.to_arrays().items():
        np.testing.assert_array_equal(other.to_arrays()[name], array)
