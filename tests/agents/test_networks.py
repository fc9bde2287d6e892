"""The network of Fig. 3.8, layer by layer, and what it is fed."""

import numpy as np
import pytest
import torch
from torch import nn

from semrl.agents.networks import NetworkConfig, QNetwork, StateInput

IMAGE = (84, 84)


def leaves(network):
    """The layers in the order in which a state passes through them."""
    return [layer for layer in network.modules() if not list(layer.children())]


def layers(network, kind):
    return [layer for layer in leaves(network) if isinstance(layer, kind)]


def no_plans(count):
    return torch.zeros((count, 0))


def test_images_go_through_the_layers_of_fig_3_8():
    network = QNetwork(IMAGE, 2, NetworkConfig(), seed=0)
    convolutions = [
        (c.in_channels, c.out_channels, c.kernel_size, c.stride, c.padding) for c in layers(network, nn.Conv2d)
    ]
    assert convolutions == [
        (2, 32, (8, 8), (4, 4), (0, 0)),
        (32, 64, (8, 8), (4, 4), (0, 0)),
        (64, 64, (3, 3), (1, 1), (0, 0)),
    ]
    assert [(d.in_features, d.out_features) for d in layers(network, nn.Linear)] == [(256, 256), (256, 2)]
    kinds = [type(layer).__name__ for layer in leaves(network)]
    assert kinds == ["StateInput", *["Conv2d", "ReLU"] * 3, "Flatten", "Linear", "ReLU", "Linear"]
    assert network(torch.zeros((5, 2, *IMAGE), dtype=torch.uint8), no_plans(5)).shape == (5, 2)


@pytest.mark.parametrize("n_actions", [2, 6])
def test_vectors_go_through_the_dense_layer_alone(n_actions):
    network = QNetwork((128,), n_actions, NetworkConfig(), seed=0)
    assert [(d.in_features, d.out_features) for d in layers(network, nn.Linear)] == [(256, 256), (256, n_actions)]
    assert [type(layer).__name__ for layer in leaves(network)] == ["StateInput", "Flatten", "Linear", "ReLU", "Linear"]


def test_dense_layers_follow_the_settings():
    network = QNetwork((4,), 3, NetworkConfig(hidden_units=(32, 16), layer_norm=True), seed=0)
    kinds = [type(layer).__name__ for layer in leaves(network)]
    assert kinds == ["StateInput", "Flatten", *["Linear", "LayerNorm", "ReLU"] * 2, "Linear"]
    assert [d.out_features for d in layers(network, nn.Linear)] == [32, 16, 3]


def test_the_input_is_the_current_image_and_its_difference_to_the_previous():
    states = torch.from_numpy(np.random.default_rng(0).integers(256, size=(3, 2, *IMAGE), dtype=np.uint8))
    x = StateInput(IMAGE, is_image=True)(states)
    current, previous = states[:, 0].double(), states[:, 1].double()
    assert x.dtype == torch.float32
    torch.testing.assert_close(x[:, 0].double(), current / 255, atol=1e-6, rtol=0)
    # Differences below zero must not wrap around as bytes do.
    torch.testing.assert_close(x[:, 1].double(), (current - previous) / 255, atol=1e-6, rtol=0)
    assert x[:, 1].min() < -0.9


def test_vectors_are_not_scaled_until_measured():
    states = torch.randn(5, 2, 4)
    x = StateInput((4,), is_image=False)(states)
    torch.testing.assert_close(x[:, 0], states[:, 0])
    torch.testing.assert_close(x[:, 1], states[:, 0] - states[:, 1])


def test_measured_vectors_have_mean_0_and_deviation_1():
    rng = np.random.default_rng(0)
    states = torch.from_numpy((rng.normal(size=(500, 2, 4)) * [1, 2, 0.8, 1] + [0, 5, -3, 2]).astype(np.float32))
    states[:, :, 3] = 2.0  # never varies
    layer = StateInput((4,), is_image=False)
    layer.fit(states, torch.zeros(500, 0))
    x = layer(states)
    torch.testing.assert_close(x.mean(dim=0), torch.zeros(2, 4), atol=1e-4, rtol=0)
    torch.testing.assert_close(x.std(dim=0, correction=0)[:, :3], torch.ones(2, 3), atol=1e-4, rtol=0)
    assert (x[:, :, 3] == 0).all()
    other = states.clone()
    other[:, 0, 3] = 3.0  # what did not vary is divided by half the usual deviation of its kind, not by nothing
    usual = np.sqrt(np.square(states[:, 0].numpy().std(axis=0)).mean())
    torch.testing.assert_close(layer(other)[:, 0, 3], torch.full((500,), 1 / (0.5 * float(usual))))


def test_plans_count_towards_the_usual_deviation():
    """Half the root mean square over a state of deviation 0 and 2 and a plan of 4; plans have no difference."""
    states = torch.zeros(2, 2, 2)
    states[:, 0, 1] = torch.tensor([-2.0, 2.0])
    layer = StateInput((2,), is_image=False)
    layer.fit(states, torch.tensor([[4.0], [-4.0]]))
    least = 0.5 * np.sqrt((0 + 4 + 16) / 3), 0.5 * np.sqrt((0 + 4 + 0) / 3)
    torch.testing.assert_close(1 / layer.scale, torch.tensor([[least[0], 2.0], [least[1], 2.0]], dtype=torch.float32))


def test_numbers_that_never_vary_keep_their_unit():
    layer = StateInput((2,), is_image=False)
    layer.fit(torch.full((5, 2, 2), 4.0), torch.zeros(5, 0))
    torch.testing.assert_close(layer(torch.full((1, 2, 2), 6.0))[0, 0], torch.full((2,), 2.0))


def test_images_keep_their_unit():
    states = torch.from_numpy(np.random.default_rng(0).integers(256, size=(3, 2, *IMAGE), dtype=np.uint8))
    layer = StateInput(IMAGE, is_image=True)
    before = layer(states)
    layer.fit(states, torch.zeros(len(states), 0))
    assert torch.equal(layer(states), before)


@pytest.mark.parametrize("shape", [IMAGE, (8,)])
def test_weights_follow_from_the_seed_alone(shape):
    before = torch.random.get_rng_state()
    one = QNetwork(shape, 2, NetworkConfig(), seed=5)
    assert torch.equal(torch.random.get_rng_state(), before)
    torch.rand(3)
    two = QNetwork(shape, 2, NetworkConfig(), seed=5)
    other = QNetwork(shape, 2, NetworkConfig(), seed=6)
    assert all(torch.equal(a, b) for a, b in zip(one.parameters(), two.parameters(), strict=True))
    assert not torch.equal(next(one.parameters()), next(other.parameters()))


def test_measured_values_are_saved_with_the_weights_but_not_learned():
    network = QNetwork((4,), 2, NetworkConfig(normalise_input=True), seed=0)
    assert {"state_input.mean", "state_input.scale"} <= set(network.state_dict())
    assert all(not name.startswith("state_input.") for name, _ in network.named_parameters())


def test_sines_and_cosines_stand_beside_the_numbers():
    network = QNetwork((3,), 2, NetworkConfig(frequencies=2), seed=0)
    shown = network.body(network.state_input(torch.tensor([[[0.5, 1.0, -2.0], [0.5, 0.5, 0.5]]])))[0].numpy()
    numbers = np.array([0.5, 1.0, -2.0, 0.0, 0.5, -2.5], np.float32)
    angles = np.outer(numbers, [1, 2]).ravel()
    np.testing.assert_allclose(shown, np.concatenate([numbers, np.sin(angles), np.cos(angles)]), atol=1e-6)
    assert network.dense[0].in_features == 30


@pytest.mark.parametrize(("shape", "width"), [(IMAGE, 256), ((4,), 8)])
def test_a_plan_stands_beside_the_state_in_front_of_the_dense_layers(shape, width):
    network = QNetwork(shape, 2, NetworkConfig(), seed=0, plan_size=3)
    shown = []
    network.dense.register_forward_hook(lambda _, inputs, __: shown.append(inputs[0]))
    plans = torch.tensor([[1.0, -7.0, 0.5], [0.0, 2.0, -0.25]])
    network(torch.randint(256, (2, 2, *shape), dtype=torch.uint8), plans)
    assert shown[0].shape == (2, width + 3) and network.dense[0].in_features == width + 3
    assert torch.equal(shown[0][:, width:], plans)


def test_a_plan_stays_as_it_is():
    """While the input is measured there is none yet, so its scale is not known."""
    network = QNetwork((4,), 2, NetworkConfig(normalise_input=True, frequencies=3), seed=0, plan_size=2)
    network.state_input.fit(torch.randn(50, 2, 4) * 5 + 3, torch.zeros(50, 2))
    shown = []
    network.dense.register_forward_hook(lambda _, inputs, __: shown.append(inputs[0][0]))
    network(torch.tensor([[[1.0, 2.0, 1.0, -1.0], [0.0, 1.0, 0.0, 1.0]]]), torch.tensor([[1.0, -1.0]]))
    assert len(shown[0]) == 8 + 2 * 8 * 3 + 2 == network.dense[0].in_features  # no sines and cosines of the plan
    assert shown[0][-2:].tolist() == [1, -1]


def test_values_depend_on_the_plan():
    network = QNetwork((4,), 2, NetworkConfig(), seed=0, plan_size=2)
    states = torch.randn(1, 2, 4).repeat(2, 1, 1)
    one, two = network(states, torch.tensor([[0.0, 1.0], [1.0, 0.0]]))
    assert not torch.equal(one, two)
