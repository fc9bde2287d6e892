"""M's density is that of its mixture, and it learns what a single Gaussian cannot tell."""

import math

import numpy as np
import pytest
import torch

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl_thesis.world_models.mdn_rnn import MDNRNN, LatentEpisode, MDNRNNConfig, Prediction

TINY = MDNRNNConfig(hidden_size=8, mixtures=2, sequence_decisions=6, batch_size=4, updates=3)


def leaps(rng, length=20):
    """Play of one number that leaps to −1 or 1 at random with action 0, and to 0 with action 1, which is rewarded.

    A 3 announces that the next decision ends the game.
    """
    actions = rng.integers(2, size=length)
    places = np.zeros((length + 1, 1), np.float32)
    for i, action in enumerate(actions):
        places[i + 1] = 0 if action else rng.choice([-1.0, 1.0])
    places[length - 1 : length] = 3
    rewards = np.where(actions == 1, 1.0, 0.0).astype(np.float32)
    stds = np.full_like(places, 0.05)
    return LatentEpisode(means=places, stds=stds, actions=actions, rewards=rewards, terminated=True)


def told_of(model, episodes):
    """What M foresees of every decision, and z after it, as it goes along the episodes."""
    for one in episodes:
        state, z = model.begin(1), torch.from_numpy(one.means)
        for i in range(len(one.actions)):
            told, state = model.step(state, z[i : i + 1], torch.from_numpy(one.actions[i : i + 1]))
            yield told, z[i + 1 : i + 2], one, i


def test_the_mixture_beats_one_gaussian_and_knows_reward_and_end():
    rng = np.random.default_rng(0)
    episodes, held_out = [leaps(rng) for _ in range(60)], [leaps(rng) for _ in range(10)]
    likelihoods = {}
    for mixtures in (1, 3):
        config = MDNRNNConfig(
            hidden_size=24, mixtures=mixtures, sequence_decisions=20, batch_size=16, updates=250, learning_rate=3e-2
        )
        model = MDNRNN(config, 1, 2, seed=0).fit(episodes)
        likelihoods[mixtures] = np.mean([told.log_likelihood(z) for told, z, _, _ in told_of(model, held_out)])
    # Half of all leaps go either way: one Gaussian must be as wide as the two are apart.
    assert likelihoods[3] > likelihoods[1] + 0.5
    told = [(p.reward.item(), one.rewards[i], p.done_logit.item(), i) for p, _, one, i in told_of(model, held_out)]
    foreseen, true, ends, places = map(np.array, zip(*told, strict=True))
    assert np.abs(foreseen - true).max() < 0.3
    assert ends[places == 19].min() > 0 > ends[places < 19].max()


def prediction(rng, batch=(4,), k=3, d=2):
    logits = torch.randn(*batch, k, generator=rng)
    means, log_stds = torch.randn(2, *batch, k, d, generator=rng)
    zero = torch.zeros(batch)
    return Prediction(torch.log_softmax(logits, dim=-1), means, log_stds, zero, zero)


@pytest.mark.parametrize("batch", [(4,), (2, 5)])
def test_log_likelihood_is_that_of_the_mixture(batch):
    told = prediction(torch.Generator().manual_seed(1), batch)
    parts = torch.distributions.Independent(torch.distributions.Normal(told.means, told.log_stds.exp()), 1)
    mixture = torch.distributions.MixtureSameFamily(torch.distributions.Categorical(logits=told.log_weights), parts)
    z = torch.randn(*batch, 2, generator=torch.Generator().manual_seed(2))
    torch.testing.assert_close(told.log_likelihood(z), mixture.log_prob(z))


@pytest.mark.parametrize("temperature", [0.5, 1.0, 2.0])
def test_samples_follow_the_temperature(temperature):
    n = 4000
    logits = torch.log(torch.tensor([0.8, 0.2])).repeat(n, 1)
    means = torch.tensor([[-10.0], [10.0]]).repeat(n, 1, 1)
    told = Prediction(logits, means, torch.full((n, 2, 1), math.log(0.5)), torch.zeros(n), torch.zeros(n))
    z = told.sample(temperature, torch.Generator().manual_seed(0))
    shares = torch.tensor([0.8, 0.2]) ** (1 / temperature)
    first = z[z < 0]
    assert len(first) / n == pytest.approx(float(shares[0] / shares.sum()), abs=0.03)
    assert float(first.std()) == pytest.approx(0.5 * math.sqrt(temperature), rel=0.06)


def test_at_temperature_zero_the_likeliest_mean_is_drawn():
    told = prediction(torch.Generator().manual_seed(3))
    z = told.sample(0.0, torch.Generator())
    for row, i in enumerate(told.log_weights.argmax(dim=1)):
        assert torch.equal(z[row], told.means[row, i])


def test_numbers_drawn_together_are_of_one_component():
    n = 500
    means = torch.tensor([[-5.0, -5.0], [5.0, 5.0]]).repeat(n, 1, 1)
    even = torch.full((n, 2), math.log(0.5))
    told = Prediction(even, means, torch.full((n, 2, 2), -2.0), torch.zeros(n), torch.zeros(n))
    z = told.sample(1.0, torch.Generator().manual_seed(0))
    assert bool((z[:, 0].sign() == z[:, 1].sign()).all())
    assert set(z[:, 0].sign().tolist()) == {-1.0, 1.0}


def test_stepping_is_going_along_the_sequence():
    model = MDNRNN(TINY, 3, 2, seed=0)
    z, actions = torch.randn(4, 7, 3, generator=torch.Generator().manual_seed(0)), torch.arange(28).reshape(4, 7) % 2
    with torch.no_grad():
        whole, _ = model.network(z, actions, None)
    state = model.begin(4)
    for i in range(7):
        told, state = model.step(state, z[:, i], actions[:, i])
        for got, expected in zip(told, whole, strict=True):
            torch.testing.assert_close(got, expected[:, i])


def test_same_seed_same_weights_and_saved_is_the_same():
    episodes = [leaps(np.random.default_rng(1), length) for length in (3, 9)]  # shorter than a sequence, and longer
    one, other, third = (MDNRNN(TINY, 1, 2, seed=seed).fit(episodes) for seed in (5, 5, 6))
    assert digest(one.to_arrays()) == digest(other.to_arrays()) != digest(third.to_arrays())
    third.from_arrays(one.to_arrays())
    assert digest(third.to_arrays()) == digest(one.to_arrays())


def test_no_decisions_are_refused():
    with pytest.raises(DataError, match="no decisions"):
        MDNRNN(TINY, 1, 2, seed=0).fit([leaps(np.random.default_rng(0), 0)])


@pytest.mark.parametrize("wrong", [{"mixtures": 0}, {"updates": 0}, {"reward_weight": -1.0}, {"learning_rate": 0.0}])
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(UsageError):
        MDNRNNConfig(**wrong)
