"""V learns to draw Catch from z, and its loss is the bound it is said to be."""

from itertools import starmap

import numpy as np
import pytest
import torch

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl_thesis.world_models.play import random_rollouts, shrink
from semrl_thesis.world_models.vae import VAE, VAEConfig, negative_bound, reconstruction_errors

TINY = VAEConfig(latent_size=4, channels=(4, 4, 8, 8), batch_size=16, updates=2)


@pytest.fixture(scope="module")
def frames():
    seen = []
    game = Game(make_env("semrl/Catch-v0", EnvironmentConfig()), 0)
    random_rollouts(game, 200, 0, lambda _i, frame: seen.append(shrink(frame)))
    return np.stack(seen)


def test_v_draws_catch_better_than_the_mean_image(frames):
    learned, held_out = frames[:160], frames[160:]
    config = VAEConfig(latent_size=16, channels=(8, 16, 16, 16), batch_size=16, updates=260)
    vae = VAE(config, seed=0).fit(learned)
    of_vae, of_mean = reconstruction_errors(vae, held_out)
    assert of_vae < 0.8 * of_mean
    untrained, same_mean = reconstruction_errors(VAE(config, seed=0), held_out)
    assert untrained > of_mean == same_mean


def test_errors_are_sums_over_a_frame(frames):
    vae = VAE(TINY, seed=1)
    of_vae, of_mean = reconstruction_errors(vae, frames[:3])
    seen = frames[:3] / 255
    drawn = vae.decode(vae.encode(frames[:3])[0])
    assert of_vae == pytest.approx(((drawn - seen) ** 2).reshape(3, -1).sum(axis=1).mean())
    assert of_mean == pytest.approx(3 * 64 * 64 * 3 / 3 * seen.var(axis=0).mean())


@pytest.mark.parametrize("weight", [1.0, 4.0])
def test_the_loss_is_bernoulli_likelihood_and_divergence(weight):
    rng = torch.Generator().manual_seed(0)
    logits, seen = torch.randn(2, 3, 4, 4, generator=rng), torch.rand(2, 3, 4, 4, generator=rng).round()
    mean, log_var = torch.randn(2, 5, generator=rng), torch.randn(2, 5, generator=rng)
    likelihood = torch.distributions.Bernoulli(logits=logits).log_prob(seen).sum(dim=(1, 2, 3))
    posterior, prior = torch.distributions.Normal(mean, (0.5 * log_var).exp()), torch.distributions.Normal(0.0, 1.0)
    divergence = torch.distributions.kl_divergence(posterior, prior).sum(dim=1)
    bound = negative_bound(logits, seen, mean, log_var, weight)
    torch.testing.assert_close(bound, (divergence - weight * likelihood).mean())


def test_same_seed_same_weights_and_saved_is_the_same(frames):
    global_state = torch.random.get_rng_state()
    one, other, third = starmap(lambda c, seed: VAE(c, seed=seed).fit(frames), [(TINY, 3), (TINY, 3), (TINY, 4)])
    assert digest(one.to_arrays()) == digest(other.to_arrays()) != digest(third.to_arrays())
    third.from_arrays(one.to_arrays())
    for got, expected in zip(third.encode(frames[:5]), one.encode(frames[:5]), strict=True):
        np.testing.assert_array_equal(got, expected)
    assert torch.equal(global_state, torch.random.get_rng_state())


@pytest.mark.parametrize(("shape", "dtype"), [((2, 64, 64), "u1"), ((2, 32, 64, 3), "u1"), ((2, 64, 64, 3), "f4")])
def test_other_images_are_refused(shape, dtype):
    with pytest.raises(DataError, match="expected RGB frames"):
        VAE(TINY, seed=0).encode(np.zeros(shape, dtype))


def test_nothing_to_learn_from_is_refused_and_to_encode_is_none(frames):
    with pytest.raises(DataError, match="no frames"):
        VAE(TINY, seed=0).fit(frames[:0])
    assert [part.shape for part in VAE(TINY, seed=0).encode(frames[:0])] == [(0, 4), (0, 4)]


@pytest.mark.parametrize("wrong", [{"latent_size": 0}, {"updates": 0}, {"pixel_weight": 0.0}, {"learning_rate": -1.0}])
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(UsageError):
        VAEConfig(**wrong)
