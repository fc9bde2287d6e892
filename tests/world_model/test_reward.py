"""Signs of rewards, by the thesis's machines and by a network (§3.4.3)."""

import numpy as np
import pytest
from sklearn.linear_model import SGDClassifier
from systems import N_ACTIONS, copied, transitions, walk

from semrl.core import Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import SemrlError, UsageError
from semrl.world_model import Experience, RewardConfig, RewardNetwork, RewardSVM, make_reward_model
from semrl.world_model.network import features

D = 3
SVM = RewardConfig()
NETWORK = RewardConfig(kind="network")
BOTH = pytest.mark.parametrize("config", [SVM, NETWORK], ids=["svm", "network"])


def model_of(config, seed=0):
    return make_reward_model(config, D, N_ACTIONS, seed=seed)


def halves(count=400, seed=0):
    """To the left of a strip there is a loss, to the right a gain, whatever is done."""
    rng = np.random.default_rng(seed)
    states, actions = rng.uniform(-2, 2, size=(count, D)), rng.integers(N_ACTIONS, size=count)
    rewards = np.select([states[:, 0] > 0.5, states[:, 0] < -0.5], [1, -1], 0)
    return transitions(states, states - 0.1 * rng.normal(size=states.shape), actions, states, rewards)


def predicted(model, data):
    return model.predict(data.states, data.previous, data.actions)


def test_the_defaults_are_the_thesiss():
    assert (SVM.kind, SVM.svm_lambda, SVM.epochs) == ("svm", 1e-4, 1)
    assert isinstance(model_of(SVM), RewardSVM) and isinstance(model_of(NETWORK), RewardNetwork)
    assert model_of(NETWORK).network.layers[0].weight.shape == (128, 2 * D + N_ACTIONS)


def test_the_machines_are_scikit_learns():
    """Three hinges, one against all, step size 1 / (λ (t + t₀)); fed the same rows they agree, also when restored."""
    training_set = [walk(80, seed, D).transitions for seed in range(6)]
    reference = SGDClassifier(loss="hinge", alpha=1e-4, learning_rate="optimal", random_state=3)
    model = model_of(SVM, seed=3)
    for i, lesson in enumerate(training_set):
        rows = features(lesson.states, lesson.previous, lesson.actions, N_ACTIONS).astype(np.float64)
        reference.partial_fit(rows, np.sign(lesson.rewards).astype(int), classes=[-1, 0, 1])
        assert model.partial_fit(lesson) is model
        if i == 2:
            saved = copied(model)
            model = model_of(SVM, seed=3).partial_fit(training_set[5])  # used before
            model.from_arrays(saved)
        state = model.to_arrays()
        np.testing.assert_array_equal(state["planes"], reference.coef_)
        np.testing.assert_array_equal(state["offsets"], reference.intercept_)
        assert state["steps"] == reference.t_ == 80 * (i + 1) + 1
        test = walk(200, 99, D).transitions
        rows = features(test.states, test.previous, test.actions, N_ACTIONS).astype(np.float64)
        np.testing.assert_array_equal(predicted(model, test), reference.predict(rows))


def test_the_machines_find_a_gain_on_one_side_and_a_loss_on_the_other():
    model, data = model_of(SVM), halves()
    for _ in range(20):
        model.partial_fit(data)
    test = halves(seed=1)
    told = predicted(model, test)
    for sign in (-1, 1):
        assert (told[sign * test.states[:, 0] > 1] == sign).mean() > 0.9


def test_the_network_finds_what_no_plane_divides():
    """A gain only in the middle and only by one action: linear machines cannot tell it."""
    rng = np.random.default_rng(0)
    states, actions = rng.uniform(-2, 2, size=(800, D)), rng.integers(N_ACTIONS, size=800)
    rewards = np.where((np.abs(states[:, 0]) < 1) & (actions == 1), 1, -1)
    data = transitions(states, states, actions, states, rewards)
    shares = {}
    for name, config in (("svm", SVM), ("network", NETWORK)):
        model = model_of(config)
        for _ in range(40):
            model.partial_fit(data)
        shares[name] = (predicted(model, data)[actions == 1] == rewards[actions == 1]).mean()
    assert shares["network"] > 0.93 and shares["svm"] < 0.8


def corridor(decisions=6000, seed=0):
    """A gain for action 2 in one corner of three, about once in a hundred decisions."""
    rng = np.random.default_rng(seed)
    states, actions = rng.uniform(-1, 1, size=(decisions + 1, D)), rng.integers(N_ACTIONS, size=decisions)
    rewards = (states[:-1, 0] > 0.7) & (states[:-1, 1] > 0.6) & (actions == 2)
    return Trajectory(states=states.astype(np.float32), actions=actions, rewards=rewards.astype(np.float32))


def test_rare_rewards_are_learned_from_balanced_draws():
    episode, test = corridor(), corridor(4000, seed=1).transitions
    assert 0.005 < episode.rewards.mean() < 0.015
    experience, rng = Experience(10_000, D), np.random.default_rng(0)
    experience.add(episode)
    model = model_of(NETWORK)
    for _ in range(40):
        model.partial_fit(experience.draw_balanced(rng, 640))
    told, targets = predicted(model, test), test.rewards > 0
    assert set(told.tolist()) == {0, 1}
    assert (told[targets] == 1).mean() > 0.8 and (told[~targets] == 0).mean() > 0.97


@BOTH
def test_only_the_sign_counts(config):
    data, large = halves(), halves()
    large.rewards[:] *= 40
    one, two = model_of(config).partial_fit(data), model_of(config).partial_fit(large)
    assert digest(one.to_arrays()) == digest(two.to_arrays())


@BOTH
def test_before_anything_was_learned_nothing_is_expected(config):
    told = predicted(model_of(config), halves(7))
    assert told.tolist() == [0] * 7 and told.dtype == np.int64
    assert predicted(model_of(config).partial_fit(halves()), halves(7)).dtype == np.int64


@BOTH
def test_saved_midway_it_goes_on_bit_for_bit(config):
    training_set = [walk(70, seed, D).transitions for seed in range(6)]
    unbroken, restored = model_of(config), model_of(config)
    restored.partial_fit(training_set[5])  # used before
    for i, lesson in enumerate(training_set):
        if i == 3:
            restored.from_arrays(copied(unbroken))
        unbroken.partial_fit(lesson)
        if i >= 3:
            restored.partial_fit(lesson)
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    np.testing.assert_array_equal(predicted(restored, training_set[0]), predicted(unbroken, training_set[0]))


@BOTH
def test_a_fresh_one_is_restored_as_fresh(config):
    model = model_of(config)
    fresh = copied(model)
    model.partial_fit(halves()).from_arrays(fresh)
    assert digest(model.to_arrays()) == digest(fresh) and not predicted(model, halves()).any()


def test_divergence_is_told():
    model = model_of(RewardConfig(kind="network", hidden_units=(16, 16), learning_rate=1e25))
    with pytest.raises(SemrlError, match="diverged"):
        for _ in range(5):
            model.partial_fit(halves())


@pytest.mark.parametrize("bad", [np.inf, np.nan])
def test_what_is_not_finite_is_told(bad):
    data = halves()
    data.states[50, 1] = bad
    with pytest.raises(SemrlError, match="diverged"):
        model_of(NETWORK).partial_fit(halves()).partial_fit(data)
    machines = model_of(SVM).partial_fit(halves())
    before = digest(copied(machines))
    with pytest.raises(ValueError, match="contains"):
        machines.partial_fit(data)
    assert digest(machines.to_arrays()) == before


@pytest.mark.parametrize(
    "values",
    [
        {"hidden_units": (0,)},
        {"batch_size": 0},
        {"epochs": 0},
        {"learning_rate": 0.0},
        {"svm_lambda": 0.0},
        {"svm_lambda": np.nan},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        RewardConfig(**values)
