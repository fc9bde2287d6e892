"""A world with laws is learned in concepts: predicted, saved, and with more things than it was learned from."""

import numpy as np
import pytest
from rallies import BALL, facts_of, history_of, rally, table, thing, trajectory_of

from semrl.core import History, Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import UsageError
from semrl.world_model import LiftedConfig, LiftedWorld

CONFIG = LiftedConfig(members=2, screening=0, first_decisions=200)
HORIZON = 15


def learned(config=CONFIG, seeds=range(3), decisions=1000):
    world = LiftedWorld(config, 6, seed=1, discount=0.95)
    for seed in seeds:
        world.partial_fit(trajectory_of(*rally(decisions, seed)))
    return world


@pytest.fixture(scope="module")
def world():
    """Learned from three thousand decisions. Read only."""
    return learned()


@pytest.fixture(scope="module")
def new_play():
    return trajectory_of(*rally(800, 77))


def test_places_are_predicted_far_ahead(world, new_play):
    near, far = [], []
    for t in range(5, 780 - HORIZON, 7):
        if new_play.rewards[t : t + HORIZON].any():
            continue
        told = world.imagine(history_of(new_play, t), new_play.actions[None, t : t + HORIZON])
        wrong = 83 * np.abs(told.states[0] - new_play.states[t + 1 : t + HORIZON + 1]).max(axis=1)
        near.append(wrong[:3].max() < 1)
        far.append(wrong[-1] < 4)
    assert len(near) > 30 and np.mean(near) > 0.9 and np.mean(far) > 0.8


def test_losses_are_predicted_and_only_those(world, new_play):
    came, told_rightly, false = 0, 0, 0
    for t in range(5, 780 - HORIZON, 5):
        told = world.imagine(history_of(new_play, t), new_play.actions[None, t : t + HORIZON])
        lost = np.flatnonzero(new_play.rewards[t : t + HORIZON])
        predicted = np.flatnonzero(np.rint(told.rewards[0]))
        came += len(lost) > 0
        told_rightly += len(lost) > 0 and len(predicted) > 0 and abs(predicted[0] - lost[0]) <= 1
        false += len(lost) == 0 and len(predicted) > 0
    assert came > 15 and told_rightly > 0.6 * came and false < 0.2 * came


def test_actions_matter_to_what_is_controlled_alone(world, new_play):
    history = history_of(new_play, 50)
    up, down = world.imagine(history, np.array([[0] * 8, [1] * 8])).states
    own, ball = slice(0, 2), slice(3, 5)
    assert 83 * (down[-1, own] - up[-1, own])[1] > 20
    np.testing.assert_allclose(up[:3, ball], down[:3, ball], atol=1e-6)


def test_a_second_ball_flies_like_the_first(world):
    """What was learned of one holds for both, though there was never more than one."""
    both, history = [], []
    for t in range(6):
        first, second = (20 + 2 * t, 30 + t), (50 - 2 * t, 50 - t)
        tables = [thing(k, BALL, (x, y, x + 2, y + 2), slot=k) for k, (x, y) in enumerate((first, second))]
        history.append(table(*tables))
        both.append(facts_of(history[-1]))
    told = world.imagine(
        History(states=np.array(both[::-1]), things=tuple(history[::-1]), number=5), np.zeros((1, 3), np.int64)
    )
    places = 83 * told.states[0, 2].reshape(2, 3)[:, :2] + 0.5
    np.testing.assert_allclose(places, [[37, 39], [35, 43]], atol=0.5)
    assert told.states[0, 2, [2, 5]].tolist() == [1, 1]


def test_it_goes_on_where_it_was_saved(world, new_play):
    again = LiftedWorld(CONFIG, 6, seed=1, discount=0.95)
    again.from_arrays(world.to_arrays())
    player = LiftedWorld(CONFIG, 6, seed=1, discount=0.95)
    player.from_arrays(world.inference_arrays())
    sequences = np.array([[0, 1, 0, 1], [1, 1, 1, 1]])
    told = [one.imagine(history_of(new_play, 60), sequences) for one in (world, again, player)]
    for name in ("actions", "states", "rewards", "values", "uncertainties"):
        for other in told[1:]:
            np.testing.assert_array_equal(getattr(told[0], name), getattr(other, name))
    grown = learned()
    assert digest(grown.to_arrays()) == digest(world.to_arrays())
    for one in (grown, again):
        one.partial_fit(new_play)
    assert digest(grown.to_arrays()) == digest(again.to_arrays())


def test_it_learns_while_an_episode_goes_on(new_play):
    world = LiftedWorld(CONFIG, 6)
    world.partial_fit(trajectory_of(*rally(150, 0)))
    assert not world.is_fitted
    part = Trajectory(
        states=new_play.states[:101],
        actions=new_play.actions[:100],
        rewards=new_play.rewards[:100],
        things=new_play.things[:101],
    )
    world.update_online(part)
    assert world.is_fitted and len(world.play) == 150


def test_scenarios_that_begin_alike_are_predicted_as_if_alone(world, new_play):
    rng = np.random.default_rng(0)
    sequences = rng.integers(2, size=(12, 9))
    sequences[6:, :5] = sequences[2, :5]
    sequences[9] = sequences[0]
    together = world.imagine(history_of(new_play, 90), sequences)
    for i, one in enumerate(sequences):
        alone = world.imagine(history_of(new_play, 90), one[None])
        np.testing.assert_array_equal(alone.states[0], together.states[i])
        np.testing.assert_array_equal(alone.rewards[0], together.rewards[i])
        np.testing.assert_array_equal(alone.values[0], together.values[i])


def test_old_play_is_forgotten_whole_episodes_at_a_time():
    world = LiftedWorld(LiftedConfig(members=1, screening=0, capacity=500, first_decisions=10_000), 6)
    for seed in range(4):
        world.partial_fit(trajectory_of(*rally(200, seed)))
    assert len(world.play) == 400 and world.play.sizes.sum() == len(world.play.things)
    assert (world.play.actions == -1).sum() == 2


def test_an_episode_without_things_is_refused():
    bare = Trajectory(
        states=np.zeros((3, 6), np.float32), actions=np.zeros(2, np.int64), rewards=np.zeros(2, np.float32)
    )
    with pytest.raises(UsageError, match="follows them"):
        LiftedWorld(CONFIG, 6).partial_fit(bare)


@pytest.mark.parametrize("wrong", [{"members": 0}, {"screening": 9}, {"draw_share": 0.0}, {"least_gain": -1.0}])
def test_settings_that_mean_nothing_are_refused(wrong):
    with pytest.raises(UsageError):
        LiftedConfig(**wrong)


def test_sizes_are_refused():
    with pytest.raises(UsageError, match=r"do without slot_assigner\.sizes"):
        LiftedWorld(CONFIG, 5, axes=np.array([0, 1, 2, 3, -1]))
