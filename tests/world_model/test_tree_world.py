"""A world of rules is learned by trees while it is lived in (§3.4.3)."""

import dataclasses

import numpy as np
import pytest
from systems import copied, walk

from semrl.core import History, Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import UsageError
from semrl.world_model import TreesConfig, TreeWorld
from semrl.world_model.tree_kernels import width
from semrl.world_model.tree_world import MAX_DIMENSION

CONFIG = TreesConfig(members=2, resolution=1.0, first_decisions=50, new_decisions=20)


def rally(decisions, seed=0):
    """A ball goes up and down between a wall at 0 and a bat near 19 that is pushed; a loss and a new ball where missed.

    The bat has inertia: it moves by this action and the one before.
    """
    rng = np.random.default_rng(seed)
    x, y, speed, bat, last = 5, int(rng.integers(20)), 1, 10, 0
    states, actions, rewards = [(x, y, bat)], [], []
    for _ in range(decisions):
        action = int(rng.integers(2)) if rng.random() < 0.9 else int(y > bat)
        bat = int(np.clip(bat + (2 * action - 1) + (2 * last - 1), 0, 19))
        last, reward = action, 0
        x += speed
        if x == 19 and abs(y - bat) <= 4:
            speed = -1
        elif x == 19:
            x, y, speed, reward = 5, int(rng.integers(20)), 1, -1
        elif x == 0:
            speed = 1
        states.append((x, y, bat))
        actions.append(action)
        rewards.append(reward)
    return Trajectory(
        states=np.array(states, np.float32), actions=np.array(actions), rewards=np.array(rewards, np.float32)
    )


def history_of(trajectory, t):
    return History(states=trajectory.states[t::-1], actions=trajectory.actions[:t][::-1], number=t)


def learned(config, *trajectories, seed=0):
    made = TreeWorld(config, 3, seed=seed)
    for trajectory in trajectories:
        made.partial_fit(trajectory)
    return made


@pytest.fixture(scope="module")
def world():
    """Learned from twelve thousand decisions. Read only."""
    return learned(dataclasses.replace(CONFIG, members=3), *(rally(3000, seed) for seed in range(4)))


def test_what_comes_next_is_foreseen(world):
    test, right, rewarded = rally(1500, seed=9), [], []
    for t in range(10, 1490):
        told = world.imagine(history_of(test, t), test.actions[None, t : t + 1])
        if test.rewards[t]:
            rewarded.append(told.rewards[0, 0] < -0.5)
        else:
            right.append(np.abs(told.states[0, 0] - test.states[t + 1]).max() < 0.5 and abs(told.rewards[0, 0]) < 0.5)
    assert np.mean(right) > 0.97 and len(rewarded) > 10 and np.mean(rewarded) > 0.8


def test_a_loss_is_foreseen_long_before_it_comes(world):
    test = rally(1500, seed=9)
    told, came = [], []
    for t in range(20, 1480):
        if 10 <= test.states[t, 0] < 13 and test.states[t, 0] > test.states[t - 1, 0]:
            left = 19 - int(test.states[t, 0])
            told.append(world.imagine(history_of(test, t), test.actions[None, t : t + left]).rewards.min() < -0.5)
            came.append(test.rewards[t : t + left].min() < 0)
    assert np.mean(came) > 0.1 and np.mean(np.array(told) == came) > 0.9


def test_scenarios_stand_still_after_a_reward(world):
    test = rally(1500, seed=9)
    t = int(np.flatnonzero(test.rewards)[5])
    told = world.imagine(history_of(test, t), np.repeat(test.actions[None, t : t + 1], 6, axis=1))
    assert told.rewards[0, 0] < -0.5 and not told.rewards[0, 1:].any()
    assert (told.states[0, 1:] == told.states[0, 0]).all()


def test_what_is_expected_beyond_is_the_return_that_came():
    lived = [rally(3000, seed) for seed in range(4)]
    made = TreeWorld(dataclasses.replace(CONFIG, members=3), 3, discount=0.9)
    for episode in lived:
        made.partial_fit(episode)
    test, told, came = rally(1500, seed=9), [], []
    for t in range(10, 1400):
        scenario = made.imagine(history_of(test, t), test.actions[None, t : t + 2])
        if not test.rewards[t : t + 2].any() and not scenario.rewards.any():
            told.append(scenario.values[0])
            came.append((test.rewards[t + 2 :] * 0.9 ** np.arange(len(test) - t - 2)).sum())
    assert np.corrcoef(told, came)[0, 1] > 0.7 and abs(np.mean(told) - np.mean(came)) < 0.05
    none = TreeWorld(dataclasses.replace(CONFIG, value_leaf_decisions=0), 3, discount=0.9)
    none.partial_fit(lived[0])
    assert not none.imagine(history_of(test, 9), np.zeros((4, 5), np.int64)).values.any()


@pytest.mark.parametrize("most", [10_000, 1_000_000])
def test_of_too_many_decisions_some_are_drawn(most):
    made = learned(dataclasses.replace(CONFIG, most_numbers=most), rally(3000))
    in_root = made.forests.tree(0).rows[0]
    columns = width(3, CONFIG.past_states, CONFIG.past_actions, made.features.relations_)
    assert in_root == (3000 if most == 1_000_000 else most // columns)
    assert made.forests.tree(0).rows.size > 1


@pytest.mark.parametrize(("flips", "kept"), [(1, [0, 1, 2]), (4, [0, 1, 2, 3])])
def test_numbers_that_hardly_ever_change_are_left_out(flips, kept):
    part = rally(2000)
    rare = (np.arange(len(part) + 1) % 500 == 7) & (np.arange(len(part) + 1) < 500 * flips)
    flipped = np.cumsum(rare).astype(np.float32)[:, None]
    made = TreeWorld(CONFIG, 4)
    made.partial_fit(dataclasses.replace(part, states=np.hstack([part.states, flipped])))
    assert made.features.varying_.tolist() == kept


def test_numbers_that_are_always_the_same_are_left_out_and_stay():
    lived = [rally(300, seed) for seed in range(2)]
    wide = [dataclasses.replace(part, states=np.insert(part.states, [0, 2], 7.0, axis=1)) for part in lived]
    made, plain = TreeWorld(CONFIG, 5), TreeWorld(CONFIG, 3)
    for one, other in zip(wide, lived, strict=True):
        made.partial_fit(one)
        plain.partial_fit(other)
    assert made.features.varying_.tolist() == [1, 2, 4]
    told, expected = (w.imagine(history_of(p[0], 40), np.zeros((2, 9), int)) for w, p in ((made, wide), (plain, lived)))
    np.testing.assert_array_equal(told.states[:, :, made.features.varying_], expected.states)
    assert (told.states[:, :, [0, 3]] == 7).all()
    np.testing.assert_array_equal(told.rewards, expected.rewards)


def test_what_goes_on_by_itself_does_so_at_a_speed_never_seen():
    """One thing glides between walls at speeds 1 to 3; another jumps when an action says so, and stays where it is."""
    rng, state, speed, states = np.random.default_rng(0), [50, 0], 2, []
    actions = rng.integers(2, size=1500)
    for action in [*actions, 0]:
        states.append(tuple(state))
        if not 0 < state[0] + speed < 100:
            speed = -int(np.sign(speed)) * int(rng.integers(1, 4))
        state = [state[0] + speed, 5 - state[1] if action else state[1]]
    made = TreeWorld(CONFIG, 2)
    made.partial_fit(
        Trajectory(states=np.array(states, np.float32), actions=actions, rewards=np.zeros(1500, np.float32))
    )
    assert made.features.inertia_.tolist() == [1, 0]
    swift = np.array([[50, 0], [43, 0], [36, 0], [29, 0]], np.float32)
    told = made.imagine(History(states=swift, actions=np.zeros(3, np.int64), number=4), np.array([[0, 1, 0]]))
    assert told.states[0].tolist() == [[57, 0], [64, 5], [71, 5]]
    assert made.rules(["glider", "jumper"], ["stay", "jump"])[0].about == "the change of glider"


def test_it_learns_while_the_episode_goes_on():
    made, episode = TreeWorld(CONFIG, 3), rally(200)
    for t in (30, 60, 70):
        part = Trajectory(states=episode.states[: t + 1], actions=episode.actions[:t], rewards=episode.rewards[:t])
        made.update_online(part)
        grown = [0, 0] if t < 50 else [60, 60]  # ten decisions more are too few
        assert (made.is_fitted, made.grown_.tolist()) == (t >= 50, grown)
    assert len(made.experience) == 0  # the episode is remembered when it is over
    made.partial_fit(episode)
    assert len(made.experience) == 200 and made.grown_.tolist() == [200, 200]  # one number had never changed before
    made.partial_fit(rally(30, seed=1))
    assert made.grown_.tolist() == [230, 200]
    made.partial_fit(rally(30, seed=2))
    assert made.grown_.tolist() == [230, 260]  # the oldest first


def test_the_more_there_is_to_see_the_longer_a_forest_waits():
    config = dataclasses.replace(CONFIG, grown_numbers=2_000)
    often, seldom = learned(CONFIG), learned(config)
    grown = {made: [] for made in (often, seldom)}
    for i in range(40):
        for made, times in grown.items():
            made.partial_fit(walk(25, i))
            times.append(int(made.grown_.max()))
    waits = {made: np.unique(np.diff(np.unique(times))) for made, times in grown.items()}
    columns = width(3, CONFIG.past_states, CONFIG.past_actions, often.features.relations_)
    assert waits[often].max() == 50  # the next multiple of 25 above a share of 0.03
    assert waits[seldom].min() >= 50 * columns * 5 / 2_000  # three numbers, reward, return; the first 50 decisions
    assert waits[seldom].max() >= 500 * columns * 5 / 2_000


def test_gains_that_follow_each_other_end_nothing_that_is_imagined():
    """A walker is paid at every third place."""
    walked = walk(600)
    paid = dataclasses.replace(walked, rewards=(np.arange(600) % 3 == 2).astype(np.float32))
    made, other = (learned(dataclasses.replace(CONFIG, reward_gap=gap), paid) for gap in (5, 2))
    assert made.features.ending_.tolist() == [True, False] and other.features.ending_.all()
    restored = TreeWorld(CONFIG, 3)
    restored.from_arrays(trees_of(made))
    assert restored.features.ending_.tolist() == [True, False]
    older = TreeWorld(CONFIG, 3)
    older.from_arrays({name: array for name, array in trees_of(made).items() if name != "ending"})
    assert older.features.ending_.all()


def test_what_goes_on_by_itself_stays_so_unless_it_is_clear():
    """Whether it does is decided anew only by a lead of a twentieth of the decisions."""
    rng, made = np.random.default_rng(0), TreeWorld(CONFIG, 1)

    def gliding(share):
        """Go on in so many stretches of ten decisions, and stumble, a step in two, in the others."""
        goes = np.repeat(rng.permutation(100) < 100 * share, 10)
        states = np.concatenate([[0], np.cumsum(goes | (np.arange(1000) % 2 == 0))]).astype(np.float32)[:, None]
        return Trajectory(states=states, actions=rng.integers(2, size=1000), rewards=np.zeros(1000, np.float32))

    told = []
    for share in (0.8, 0.0, 0.2, 0.0, 0.75):  # in the third and the last episode it is not clear
        made.partial_fit(gliding(share))
        told.append(made.features.inertia_.tolist())
    assert told == [[1], [1], [1], [0], [0]]


def test_forests_doubt_what_they_disagree_about(world):
    test = rally(1500, seed=9)
    t = int(np.flatnonzero(test.rewards)[5]) - 12
    sequences = np.random.default_rng(0).integers(2, size=(40, 12))
    told = world.imagine(history_of(test, t), sequences)
    _, rewards, values = world.forests.roll(
        world.features.inertia_,
        history_of(test, t).window(4),
        history_of(test, t).recent(3),
        sequences,
        world.features.relations_,
    )
    np.testing.assert_allclose(told.uncertainties, (rewards.sum(axis=2) + values).std(axis=0), atol=1e-6)
    assert told.uncertainties.shape == (40,) and told.uncertainties.max() > 0


def test_screened_scenarios_are_those_that_the_first_forests_think_best_of(world):
    test, sequences = rally(1500, seed=9), np.random.default_rng(0).integers(2, size=(40, 12))
    screening = copied_world(world, screening=1)
    first = copied_world(world, members=1)
    for t in range(50, 1200, 50):
        whole, told, alone = (made.imagine(history_of(test, t), sequences) for made in (world, screening, first))
        kept = np.sort(np.argsort(-(alone.rewards.sum(axis=1) + alone.values), kind="stable")[:10])
        np.testing.assert_array_equal(told.actions, sequences[kept])
        for name in ("states", "rewards", "values", "uncertainties"):
            np.testing.assert_allclose(getattr(told, name), getattr(whole, name)[kept], atol=1e-6)
    few = sequences[:7]
    whole, told = (made.imagine(history_of(test, 50), few) for made in (world, screening))
    for name in (
        "actions",
        "states",
        "rewards",
        "values",
        "uncertainties",
    ):  # too few to screen: all are asked about all
        np.testing.assert_array_equal(getattr(told, name), getattr(whole, name))


def trees_of(world):
    """What is enough to predict."""
    return {name: array.copy() for name, array in world.inference_arrays().items()}


def copied_world(world, **settings):
    """The same trees, asked in another way."""
    made = TreeWorld(dataclasses.replace(world.config, **settings), 3)
    made.from_arrays(trees_of(world))
    return made


def test_before_and_after_an_end_are_not_mixed_up():
    """The first state of an episode follows from nothing."""
    lived = [rally(40, seed) for seed in range(3)]
    made = learned(CONFIG, *lived)
    rows, targets, other = made.features.training_set(made.experience, np.random.default_rng(0))
    assert len(rows) == 120 and other is None
    for i, episode in enumerate(lived):
        changes = np.diff(episode.states, axis=0)
        changes[1:] -= made.features.inertia_ * changes[:-1].copy()
        np.testing.assert_array_equal(targets[40 * i : 40 * (i + 1), :3], changes)
        assert not rows[40 * i, 6:15].any()  # nothing moved before
    returns = np.concatenate([np.cumsum(episode.rewards[::-1])[::-1] for episode in lived])
    np.testing.assert_allclose(targets[:, 4], returns)


@pytest.mark.parametrize("saved_after", [0, 1, 3])
def test_saved_midway_it_goes_on_bit_for_bit(saved_after):
    unbroken, restored = TreeWorld(CONFIG, 3), learned(CONFIG, walk(60, 9))
    for i in range(6):
        if i == saved_after:
            restored.from_arrays(copied(unbroken))
        for made in (unbroken, restored) if i >= saved_after else (unbroken,):
            made.update_online(walk(25, i))
            made.partial_fit(walk(25, i))
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    loaded = TreeWorld(CONFIG, 3)
    loaded.from_arrays(trees_of(unbroken))
    assert not len(loaded.experience)
    told = [made.imagine(history_of(walk(25), 9), np.zeros((2, 5), np.int64)) for made in (unbroken, loaded)]
    np.testing.assert_array_equal(told[0].states, told[1].states)
    np.testing.assert_array_equal(told[0].rewards, told[1].rewards)


def test_distances_are_those_along_an_axis():
    config, axes = dataclasses.replace(CONFIG, distances=True), np.array([0, 1, -1, 0, 1, -1])
    made = TreeWorld(config, 6, axes=axes)
    assert made.features.relations_[0].tolist() == [[0, 3], [1, 4]] and made.features.relations_[1]
    made.features.varying_ = np.array([0, 2, 3, 5])
    assert made.features.relations_[0].tolist() == [[0, 2]]  # among those that vary
    sized = TreeWorld(config, 10, axes=np.array([0, 1, 2, 3, -1] * 2))
    assert sized.features.relations_[0].tolist() == [
        [0, 5],
        [1, 6],
    ]  # how wide one is says nothing of how wide another is
    every = [[i, j] for i in range(6) for j in range(i + 1, 6)]
    assert TreeWorld(config, 6).features.relations_[0].tolist() == every
    assert TreeWorld(CONFIG, 6, axes=axes).features.relations_[0].tolist() == every


def test_trees_that_look_at_other_numbers_are_refused():
    made = learned(CONFIG, walk(60))
    with pytest.raises(ValueError, match="look at 25 numbers, not 31"):
        TreeWorld(dataclasses.replace(CONFIG, distances=True), 3).from_arrays(copied(made))


def test_the_oldest_episodes_are_forgotten():
    made = learned(dataclasses.replace(CONFIG, capacity=100), *(walk(40, seed) for seed in range(5)))
    assert len(made.experience) <= 100 and made.seen_ == 200


def test_states_too_long_for_trees_are_refused():
    TreeWorld(CONFIG, MAX_DIMENSION)
    with pytest.raises(UsageError, match=r"at most 60 numbers, not 61; use planning\.world_model = 'networks'"):
        TreeWorld(CONFIG, MAX_DIMENSION + 1)


@pytest.mark.parametrize(
    "values",
    [
        {"members": 0}, {"leaf_decisions": 0}, {"capacity": 0}, {"most_numbers": 0},
        {"first_decisions": 0}, {"new_decisions": 0},
        {"past_states": 1}, {"past_actions": -1}, {"resolution": 0.0}, {"new_share": -0.1},
        {"value_leaf_decisions": -1}, {"screening": -1}, {"screening": 4},
        {"counterfactuals_from": -1}, {"reward_gap": -1}, {"grown_numbers": -1},
    ],
)  # fmt: skip
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        TreesConfig(**values)
