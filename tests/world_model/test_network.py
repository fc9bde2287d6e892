"""Asked through numpy, the network answers what torch would; it learns every row once a pass."""

from itertools import chain, pairwise

import numpy as np
import pytest
import torch
from systems import copied
from torch.nn import functional

from semrl.core.arrays import digest
from semrl.core.errors import SemrlError
from semrl.world_model.network import LEAST_DEVIATION, DenseNetwork, features, spread


def a_network(hidden_units=(16,), *, layer_norm=False, learning_rate=1e-2, batch_size=32, seed=0):
    return DenseNetwork(
        5, hidden_units, 2, layer_norm=layer_norm, learning_rate=learning_rate, betas=(0.9, 0.999),
        batch_size=batch_size, seed=seed,
    )  # fmt: skip


def data(count=100, seed=0):
    rng = np.random.default_rng(seed)
    inputs = (10 * rng.normal(size=(count, 5)) + 3).astype(np.float32)
    return inputs, np.column_stack([np.abs(inputs[:, 0]), inputs[:, 1] - inputs[:, 2]]) / 10


def by_torch(network, inputs):
    with torch.no_grad():
        return network.layers(torch.from_numpy(inputs)).numpy()


@pytest.mark.parametrize("layer_norm", [False, True])
@pytest.mark.parametrize("hidden_units", [(), (16,), (16, 8, 4)])
def test_numpy_answers_what_torch_answers(hidden_units, layer_norm):
    network, (inputs, targets) = a_network(hidden_units, layer_norm=layer_norm), data()
    rows = inputs.copy()
    answers = []
    for _ in range(3):  # what was learned meanwhile counts as well
        answers.append(network(rows))
        np.testing.assert_allclose(answers[-1], by_torch(network, inputs), rtol=1e-4, atol=1e-5)
        assert answers[-1].dtype == np.float32
        for row, answer in zip(inputs[:5], answers[-1], strict=False):
            np.testing.assert_allclose(network(row[None])[0], answer, rtol=1e-4, atol=1e-5)
        network.learn(inputs, targets.astype(np.float32), functional.mse_loss)
    np.testing.assert_array_equal(rows, inputs)
    assert all(np.abs(one - two).max() > 1e-3 for one, two in pairwise(answers))
    restored = a_network(hidden_units, layer_norm=layer_norm, seed=5)
    restored.from_arrays(copied(network))
    np.testing.assert_array_equal(restored(inputs), network(inputs))
    np.testing.assert_allclose(restored(inputs), by_torch(restored, inputs), rtol=1e-4, atol=1e-5)


def test_a_pass_shows_every_row_once_in_mini_batches_of_another_order_each_time():
    network, inputs, shown = a_network(batch_size=32), data(100)[0], []

    def loss(outputs, targets):
        shown.append(targets.tolist())
        return outputs.square().mean()

    for _ in range(2):
        network.learn(inputs, np.arange(100), loss)
    assert [len(batch) for batch in shown] == 2 * [32, 32, 32, 4]
    first, second = list(chain(*shown[:4])), list(chain(*shown[4:]))
    assert sorted(first) == sorted(second) == list(range(100)) and first != second != sorted(second)


def test_rows_stay_with_what_is_wanted_of_them():
    network, inputs, pairs = a_network(()), data(50)[0], []

    def loss(outputs, targets):
        pairs.append((outputs.detach().numpy().copy(), targets.numpy().copy()))
        return 0 * outputs.sum()  # nothing changes

    expected = by_torch(network, inputs)
    network.learn(inputs, np.arange(50), loss)
    for outputs, places in pairs:
        np.testing.assert_allclose(outputs, expected[places], rtol=1e-5, atol=1e-5)


def test_it_is_adam_with_these_settings():
    network, (inputs, targets) = a_network((), batch_size=100), data()
    weights = network.layers[0].weight.detach().numpy().copy()
    errors = inputs @ weights.T + network.layers[0].bias.detach().numpy() - targets
    gradient = errors.T @ inputs / errors.size * 2
    network.learn(inputs, targets.astype(np.float32), functional.mse_loss)
    step = 1e-2 * gradient / (np.abs(gradient) + 1e-8)  # the first step of Adam
    np.testing.assert_allclose(network.layers[0].weight.detach().numpy(), weights - step, atol=1e-6)
    assert network.optimiser.param_groups[0]["betas"] == (0.9, 0.999)


def test_nothing_to_learn_changes_nothing():
    network = a_network()
    before = network(data()[0])
    network.learn(np.zeros((0, 5), np.float32), np.zeros((0, 2), np.float32), functional.mse_loss)
    np.testing.assert_array_equal(network(data()[0]), before)


def test_seeds_decide_and_global_generators_do_not():
    torch.manual_seed(1)
    one = a_network()
    state = torch.random.get_rng_state()
    torch.manual_seed(2)
    two, other = a_network(), a_network(seed=1)
    assert digest(one.to_arrays()) == digest(two.to_arrays()) != digest(other.to_arrays())
    torch.manual_seed(1)
    assert torch.equal(torch.random.get_rng_state(), state)


@pytest.mark.parametrize("layer_norm", [False, True])
def test_saved_midway_it_goes_on_bit_for_bit(layer_norm):
    inputs, targets = data()
    targets = targets.astype(np.float32)
    unbroken, restored = (a_network((16, 8), layer_norm=layer_norm) for _ in range(2))
    unbroken.learn(inputs, targets, functional.mse_loss)
    restored.learn(inputs[:7], targets[:7], functional.mse_loss)  # used before
    restored.from_arrays(copied(unbroken))
    for network in (unbroken, restored):
        for _ in range(3):
            network.learn(inputs, targets, functional.mse_loss)
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    np.testing.assert_array_equal(restored(inputs), unbroken(inputs))


def test_a_fresh_one_restores_a_used_one():
    network, (inputs, targets) = a_network(), data()
    fresh = copied(network)
    network.learn(inputs, targets.astype(np.float32), functional.mse_loss)
    network.from_arrays(fresh)  # Adam's moments are forgotten as well
    assert digest(network.to_arrays()) == digest(a_network().to_arrays())


@pytest.mark.parametrize("bad", [np.inf, np.nan])
def test_a_loss_that_is_no_number_is_told(bad):
    inputs, targets = data()
    inputs[3, 2] = bad
    with pytest.raises(SemrlError, match="diverged: try a smaller learning rate"):
        a_network().learn(inputs, targets.astype(np.float32), functional.mse_loss)


def test_a_huge_learning_rate_is_told():
    network, (inputs, targets) = a_network((16, 8), learning_rate=1e30), data()
    with pytest.raises(SemrlError, match="diverged"):
        for _ in range(3):
            network.learn(inputs, targets.astype(np.float32), functional.mse_loss)


def test_features_are_state_difference_and_action():
    rows = features(np.array([[1.0, 2.0], [5.0, 6.0]]), np.array([[0.5, 4.0], [5.0, 6.0]]), np.array([2, 0]), 3)
    assert rows.tolist() == [[1, 2, 0.5, -2, 0, 0, 1], [5, 6, 0, 0, 1, 0, 0]] and rows.dtype == np.float32


def test_spread_is_the_mean_deviation_never_close_to_nothing():
    wide = np.array([-30.0, 30.0, -30.0, 30.0], np.float32)
    rows = np.column_stack([wide, wide / 10 + 5, np.full(4, 7.0, np.float32)])
    least = LEAST_DEVIATION * np.sqrt((30**2 + 3**2) / 3)
    np.testing.assert_allclose(spread(rows), [30, max(3, least), least], rtol=1e-6)
    assert spread(np.ones((4, 2), np.float32)).tolist() == [1, 1]  # nothing varied yet


def test_one_jump_hardly_widens_the_spread():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(500, 2)).astype(np.float32)
    jumped = rows.copy()
    jumped[250] = 50
    np.testing.assert_allclose(spread(jumped), spread(rows), rtol=0.2)
    assert (jumped.std(axis=0) > 2 * rows.std(axis=0)).all()  # which the standard deviation would
