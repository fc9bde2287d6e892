"""CMA-ES solves a toy dream; dreams are fair, repeat themselves and end."""

import numpy as np
import pytest
import torch

from semrl.core.errors import DataError, UsageError
from semrl_thesis.world_models.controller import (
    ControllerConfig,
    LinearController,
    evolve,
    parameter_count,
    split,
)
from semrl_thesis.world_models.dream import Dream, DreamConfig, moments
from semrl_thesis.world_models.mdn_rnn import MDNRNN, LatentEpisode, MDNRNNConfig, Prediction

pytest.importorskip("cma")


class Corridor:
    """A model whose z is a place: action 0 goes left, 1 right, by 1; 1 of reward for getting closer to 0, else −1."""

    n_actions = 2

    def __init__(self, done_logit=-50.0):
        self.done_logit = done_logit

    def begin(self, count):
        return torch.zeros(count, 1), torch.zeros(count, 1)

    def step(self, state, z, actions):
        moved = z + (2.0 * actions[:, None] - 1)
        reward = (z.abs() - moved.abs()).flatten()
        none = torch.zeros(len(z), 1)
        told = Prediction(none, moved[:, None], none[:, None] - 20, reward, torch.full((len(z),), self.done_logit))
        return told, (state[0] + 1, state[1])


def corridor(model=None, **config):
    z = torch.tensor([[-7.5], [-4.5], [4.5], [7.5]])
    state = (torch.zeros(4, 1), torch.zeros(4, 1))
    return Dream(model or Corridor(), z, state, DreamConfig(**{"horizon_decisions": 4, **config}))


TOWARDS_ZERO = np.array([1.0, 0.0, -1.0, 0.0, 0.0, 0.0])  # left where z > 0, right where z < 0


def test_returns_are_sums_of_rewards():
    assert corridor().returns(np.stack([TOWARDS_ZERO, -TOWARDS_ZERO]), 8, seed=0).tolist() == pytest.approx([4, -4])


@pytest.mark.parametrize("seed", range(3))
def test_cma_solves_the_dream(seed):
    dream = corridor()
    config = ControllerConfig(population=8, generations=25, dreams=8)
    found, history = evolve(lambda c, i: dream.returns(c, 8, seed=i), 6, config, seed=seed)
    assert history.shape == (25,)
    assert dream.returns(found[None], 32, seed=99)[0] > 3.5 > history[0] + 1
    controller = LinearController(2, 2)
    controller.parameters = found
    assert controller.act(np.array([[5.5, 2.0], [-5.5, 2.0]])).tolist() == [0, 1]


def test_evolution_repeats_itself_and_touches_no_global_generator():
    before = np.random.get_state()[1].copy()  # noqa: NPY002 - it is what must not change
    config = ControllerConfig(population=4, generations=3)
    runs = [evolve(lambda c, _: -np.square(c - 1).sum(axis=1), 3, config, seed=seed)[0] for seed in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])
    assert np.array_equal(before, np.random.get_state()[1])  # noqa: NPY002


def test_candidates_are_tried_in_the_same_dreams():
    model = MDNRNN(MDNRNNConfig(hidden_size=4, mixtures=2), 2, 2, seed=0)
    dream = Dream(model, torch.randn(9, 2), model.begin(9), DreamConfig(horizon_decisions=5))
    features = dream.reset(3, seed=1, copies=2)
    assert torch.equal(features[:3], features[3:])
    alone = [dream.reset(3, seed=seed) for seed in range(6)]
    assert any(not torch.equal(alone[0], other) for other in alone[1:])
    parameters = np.random.default_rng(0).standard_normal((3, parameter_count(6, 2)))
    first, again, other = (dream.returns(parameters, 4, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_what_has_ended_gains_nothing():
    dream = corridor(Corridor(done_logit=50.0))
    assert dream.returns(TOWARDS_ZERO[None], 8, seed=0).tolist() == pytest.approx([1])
    dream.reset(2, seed=0)
    _, rewards, over = dream.step(torch.tensor([0, 0]))
    assert over.all()
    assert (rewards.abs() == 1).all()
    assert not dream.step(torch.tensor([0, 0]))[1].any()


def test_moments_are_those_of_real_play():
    model = MDNRNN(MDNRNNConfig(hidden_size=4, mixtures=2), 2, 2, seed=0)
    rng = np.random.default_rng(0)
    episodes = [
        LatentEpisode(
            means=rng.standard_normal((n + 1, 2), dtype=np.float32),
            stds=np.ones((n + 1, 2), np.float32),
            actions=rng.integers(2, size=n),
            rewards=np.zeros(n, np.float32),
            terminated=False,
        )
        for n in (3, 5)
    ]
    z, (hidden, cell) = moments(model, episodes, 100, seed=0)
    np.testing.assert_array_equal(z, np.concatenate([one.means[:-1] for one in episodes]))
    assert not hidden[[0, 3]].any()
    assert not cell[[0, 3]].any()
    _, expected = model.step(model.begin(1), z[3:4], torch.from_numpy(episodes[1].actions[:1]))
    torch.testing.assert_close(hidden[4:5], expected[0])
    few, _ = moments(model, episodes, 4, seed=0)
    assert few.shape == (4, 2)


def test_controller_is_linear_and_is_saved():
    rng = np.random.default_rng(0)
    controller = LinearController(3, 4)
    controller.parameters = rng.standard_normal(16)
    weights, offsets = split(controller.parameters, 3, 4)
    features = rng.standard_normal((6, 3))
    expected = [max(range(4), key=lambda a: weights[a] @ row + offsets[a]) for row in features]
    assert controller.act(features).tolist() == expected
    other = LinearController(3, 4)
    other.from_arrays(controller.to_arrays())
    assert other.act(features).tolist() == expected
    with pytest.raises(DataError, match="cannot take"):
        LinearController(2, 4).from_arrays(controller.to_arrays())


@pytest.mark.parametrize("wrong", [{"temperature": -1.0}, {"horizon_decisions": 0}, {"starts": 0}])
def test_wrong_dreams_are_refused(wrong):
    with pytest.raises(UsageError):
        DreamConfig(**wrong)


@pytest.mark.parametrize("wrong", [{"population": 1}, {"generations": 0}, {"dreams": 0}, {"initial_std": 0.0}])
def test_wrong_controllers_are_refused(wrong):
    with pytest.raises(UsageError):
        ControllerConfig(**wrong)
