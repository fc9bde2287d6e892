"""Worlds whose next state is known are learned (§3.4.3)."""

import numpy as np
import pytest
import torch
from systems import N_ACTIONS, ball, copied, explained, linear, walk

from semrl.core.arrays import digest
from semrl.core.errors import SemrlError, UsageError
from semrl.world_model import NextStateConfig, NextStateNetwork

SMALL = {"hidden_units": (64,), "learning_rate": 1e-3, "epochs": 40}
DEEP = {"hidden_units": (64, 64), "layer_norm": True, "learning_rate": 1e-3, "epochs": 40}
THESIS = NextStateConfig()
CHANGE = NextStateConfig(predict_change=True, **SMALL)


def learned(config, data, seed=0):
    model = NextStateNetwork(config, data.states.shape[1], N_ACTIONS, seed=seed)
    for _ in range(config.epochs):
        assert model.partial_fit(data) is model
    return model


def predicted(model, data):
    return model.predict(data.states, data.previous, data.actions)


def test_the_defaults_are_the_thesiss():
    assert THESIS.hidden_units == (512,) and THESIS.learning_rate == 1e-4
    assert (THESIS.adam_beta1, THESIS.adam_beta2) == (0.99, 0.999)
    assert (THESIS.batch_size, THESIS.epochs) == (64, 100)
    assert not THESIS.layer_norm and not THESIS.predict_change
    network = NextStateNetwork(THESIS, 4, N_ACTIONS).network
    linear_layers = [layer for layer in network.layers if isinstance(layer, torch.nn.Linear)]
    assert [tuple(layer.weight.shape) for layer in linear_layers] == [(512, 2 * 4 + N_ACTIONS), (4, 512)]
    assert isinstance(network.layers[1], torch.nn.ReLU) and len(network.layers) == 3
    settings = network.optimiser.param_groups[0]
    assert (settings["lr"], settings["betas"], network.batch_size) == (1e-4, (0.99, 0.999), 64)


@pytest.mark.parametrize(
    "config",
    [THESIS, CHANGE, NextStateConfig(**SMALL), NextStateConfig(predict_change=True, **DEEP)],
    ids=["thesis", "change", "whole", "deep"],
)
def test_a_linear_system_is_learned(config):
    model, test = learned(config, linear(800)), linear(500, seed=7)
    assert explained(predicted(model, test), test.next_states) > 0.9


@pytest.fixture(scope="module")
def of_ball():
    return {name: learned(config, ball(800)) for name, config in (("thesis", THESIS), ("change", CHANGE))}


def test_a_bouncing_ball_is_learned(of_ball):
    test = ball(500, seed=7)
    assert explained(predicted(of_ball["thesis"], test), test.next_states) > 0.99
    assert explained(predicted(of_ball["change"], test) - test.states, test.next_states - test.states) > 0.93


def test_small_movements_are_learned_better_as_changes(of_ball):
    test = ball(500, seed=7)
    errors = {name: np.square(predicted(of_ball[name], test) - test.next_states).mean() for name in of_ball}
    assert errors["change"] < errors["thesis"] / 4


def test_velocity_and_action_both_count(of_ball):
    """From the same place a ball flies on as it came, and a bat goes where it is told."""
    model = of_ball["change"]
    states = np.full((6, 3), 5.0, np.float32)
    previous = states.copy()
    previous[:, 0] -= np.array([0.3, -0.3, 0.3, -0.3, 0.3, -0.3])
    actions = np.array([0, 0, 1, 1, 2, 2])
    change = model.predict(states, previous, actions) - states
    np.testing.assert_allclose(change[:, 0], [0.3, -0.3] * 3, atol=0.1)
    np.testing.assert_allclose(change[:, 2], np.repeat([-0.3, 0, 0.3], 2), atol=0.1)


def test_scales_are_those_of_the_first_episode():
    model = NextStateNetwork(CHANGE, 3, N_ACTIONS).partial_fit(ball(100))
    before = {name: value for name, value in copied(model).items() if "scale" in name or "centre" in name}
    assert len(before) == 3 and np.all(before["change_scale"] < 1) and np.all(before["scale"][:3] > 1)
    model.partial_fit(ball(100, seed=1, size=1000))
    assert digest(before) == digest({name: value for name, value in model.to_arrays().items() if name in before})


def test_one_jump_does_not_spoil_what_changes_little():
    """Now and then the ball is served anew, which no model can predict; the rest is learned all the same."""
    data, test = ball(800), ball(500, seed=7)
    data.next_states[::50, :2] = 5 + 4 * np.sign(np.random.default_rng(0).normal(size=(16, 2)))
    model = learned(CHANGE, data)
    change = predicted(model, test) - test.states
    assert explained(change, test.next_states - test.states) > 0.85


def test_nothing_is_needed_before_it_predicts():
    for config in (THESIS, CHANGE):
        model, data = NextStateNetwork(config, 3, N_ACTIONS), ball(5)
        assert not model.is_fitted
        assert np.isfinite(predicted(model, data)).all() and predicted(model, data).shape == (5, 3)
        assert model.partial_fit(data).is_fitted


@pytest.mark.parametrize("config", [NextStateConfig(hidden_units=(8,)), CHANGE], ids=["whole", "change"])
def test_saved_midway_it_goes_on_bit_for_bit(config):
    training_set = [walk(70, seed).transitions for seed in range(6)]
    unbroken, restored = (NextStateNetwork(config, 3, N_ACTIONS, seed=seed) for seed in (0, 1))
    restored.partial_fit(training_set[5])  # used before
    for i, lesson in enumerate(training_set):
        if i == 3:
            restored.from_arrays(copied(unbroken))
        unbroken.partial_fit(lesson)
        if i >= 3:
            restored.partial_fit(lesson)
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    np.testing.assert_array_equal(predicted(restored, training_set[0]), predicted(unbroken, training_set[0]))


def test_a_fresh_one_is_restored_as_fresh():
    model = NextStateNetwork(CHANGE, 3, N_ACTIONS)
    fresh = copied(model)
    model.partial_fit(ball(100)).from_arrays(fresh)
    assert not model.is_fitted and digest(model.to_arrays()) == digest(fresh)


@pytest.mark.parametrize("predict_change", [False, True])
def test_divergence_is_told(predict_change):
    config = NextStateConfig(hidden_units=(16, 16), learning_rate=1e25, predict_change=predict_change)
    model = NextStateNetwork(config, 3, N_ACTIONS)
    with pytest.raises(SemrlError, match="diverged"):
        for _ in range(5):
            model.partial_fit(ball(100))


def test_what_is_infinite_is_told_as_divergence():
    model, data = NextStateNetwork(THESIS, 3, N_ACTIONS).partial_fit(ball(100)), ball(100)
    data.states[50, 1] = np.inf
    with pytest.raises(SemrlError, match="diverged"):
        model.partial_fit(data)


@pytest.mark.parametrize(
    "values",
    [
        {"hidden_units": (0,)},
        {"hidden_units": (8, -1)},
        {"batch_size": 0},
        {"epochs": 0},
        {"learning_rate": 0.0},
        {"learning_rate": np.nan},
        {"adam_beta1": 1.0},
        {"adam_beta2": -0.1},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        NextStateConfig(**values)


def test_what_is_predicted_stays_within_what_was_seen():
    """Fed its own predictions, a network goes astray without bound."""
    data = linear(400)
    ends = {}
    for within_seen in (True, False):
        model = learned(NextStateConfig(within_seen=within_seen, hidden_units=(8,), epochs=1), data)
        state, before = 50 * data.states[:3], data.previous[:3]
        ends[within_seen] = model.predict(state, before, data.actions[:3])
    low, high = data.next_states.min(axis=0), data.next_states.max(axis=0)
    assert ((ends[True] >= low) & (ends[True] <= high)).all()
    assert not ((ends[False] >= low) & (ends[False] <= high)).all()
    restored = NextStateNetwork(model.config, data.states.shape[1], N_ACTIONS)
    restored.from_arrays(copied(model))
    np.testing.assert_array_equal(restored.predict(state, before, data.actions[:3]), ends[False])
