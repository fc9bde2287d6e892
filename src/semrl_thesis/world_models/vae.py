"""V: a convolutional variational autoencoder of small RGB frames (§2.6.1; Kingma & Welling 2014)."""

import itertools
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from semrl.core import Floats
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, SemrlError, UsageError
from semrl.core.networks import arrays_to_module, module_to_arrays
from semrl_thesis.world_models.weights import seeded

SIDE_PX = 64
"""Height and width of the frames that V sees."""

_CODE_SIDE = 4  # of the feature maps after four convolutions of stride 2
_LEAST_SHADE = 1e-3  # of the mean image's pixels, whose logits must be finite
_BATCH = 256  # of frames that are encoded or decoded at once


@dataclass(frozen=True, kw_only=True)
class VAEConfig:
    """Shape of V, and how it learns."""

    latent_size: int = 32
    """Length of z. Ha & Schmidhuber use 32 and 64."""
    channels: tuple[int, int, int, int] = (16, 32, 64, 64)
    """Feature maps of the four convolutions; the decoder mirrors them."""
    pixel_weight: float = 4.0
    """What a nat of the pixels counts, against one of z: the more, the more small objects count; 1 is the bound."""
    updates: int = 2000
    """Mini-batches to learn from."""
    batch_size: int = 32
    """Frames of a mini-batch."""
    learning_rate: float = 1e-3
    """Of Adam."""

    def __post_init__(self) -> None:
        if min(self.latent_size, *self.channels, self.updates, self.batch_size) < 1:
            raise UsageError("latent_size, channels, updates and batch_size of the VAE must all be 1 or more")
        if self.pixel_weight <= 0 or self.learning_rate <= 0:
            raise UsageError("pixel_weight and learning_rate of the VAE must be above 0")


class VAE:
    """Compress frames to Gaussians over z, ``(latent_size,)``, and draw them again from z.

    Parameters
    ----------
    config
        Its shape, and how it learns.
    seed
        Of weights, mini-batches and samples.

    Examples
    --------
    >>> frames = np.zeros((6, 64, 64, 3), np.uint8)
    >>> vae = VAE(VAEConfig(latent_size=2, channels=(2, 2, 2, 2), updates=1), seed=0).fit(frames)
    >>> [part.shape for part in vae.encode(frames)]
    [(6, 2), (6, 2)]
    """

    def __init__(self, config: VAEConfig, *, seed: int) -> None:
        self.config = config
        self.seed = seed
        self.network = seeded(lambda: _Network(config), seed)

    def fit(self, frames: NDArray[np.uint8]) -> "VAE":
        """Learn from ``(n, 64, 64, 3)`` uint8 frames, RGB.

        Raises
        ------
        DataError
            When these are no such frames, or none.
        SemrlError
            When the loss is not a number.
        """
        _check(frames)
        if not len(frames):
            raise DataError("the VAE cannot learn from no frames")
        c, rng = self.config, np.random.default_rng(self.seed)
        noise = torch.Generator().manual_seed(self.seed)
        optimiser = torch.optim.Adam(self.network.parameters(), lr=c.learning_rate)
        self.network.set_background(frames)
        for _ in range(c.updates):
            seen = _to_tensor(frames[rng.integers(len(frames), size=c.batch_size)])
            mean, log_var = self.network.encode(seen)
            z = mean + torch.exp(0.5 * log_var) * torch.randn(mean.shape, generator=noise)
            loss = negative_bound(self.network.decode(z), seen, mean, log_var, c.pixel_weight)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
        if not np.isfinite(loss.item()):
            raise SemrlError("the VAE has diverged: try a smaller learning rate")
        return self

    def encode(self, frames: NDArray[np.uint8]) -> tuple[Floats, Floats]:
        """Return means and standard deviations of z, each ``(n, latent_size)`` float32, of ``(n, 64, 64, 3)`` frames.

        Raises
        ------
        DataError
            When these are no such frames.
        """
        _check(frames)
        means, stds = [], []
        with torch.inference_mode():
            for start in range(0, len(frames), _BATCH):
                mean, log_var = self.network.encode(_to_tensor(frames[start : start + _BATCH]))
                means.append(mean.numpy())
                stds.append(torch.exp(0.5 * log_var).numpy())
        none = np.zeros((0, self.config.latent_size), np.float32)
        return np.concatenate([none, *means]), np.concatenate([none, *stds])

    def decode(self, z: Floats) -> Floats:
        """Draw frames, ``(n, 64, 64, 3)`` float32 in 0 … 1, from ``(n, latent_size)``."""
        with torch.inference_mode():
            parts = [
                self.network.decode(torch.from_numpy(z[start : start + _BATCH])).sigmoid().permute(0, 2, 3, 1).numpy()
                for start in range(0, len(z), _BATCH)
            ]
        return np.concatenate([np.zeros((0, SIDE_PX, SIDE_PX, 3), np.float32), *parts])

    def to_arrays(self) -> Arrays:
        """Return the weights."""
        return module_to_arrays(self.network)

    def from_arrays(self, arrays: Arrays) -> None:
        """Become what `to_arrays` was called on."""
        arrays_to_module(self.network, arrays)


def negative_bound(logits: Tensor, seen: Tensor, mean: Tensor, log_var: Tensor, pixel_weight: float) -> Tensor:
    """Return the negative evidence lower bound of a frame in nats, with weighted pixels; the mean of a mini-batch.

    Pixels are Bernoulli, as in Kingma & Welling (2014), and z is standard normal a priori. A squared error would
    hardly tell a faint ball in about the right place from none, so that one of a few pixels is long not drawn at all.
    """
    pixels = nn.functional.binary_cross_entropy_with_logits(logits, seen, reduction="none").sum(dim=(1, 2, 3))
    divergence = 0.5 * (mean.square() + log_var.exp() - log_var - 1).sum(dim=1)
    return (pixel_weight * pixels + divergence).mean()


def reconstruction_errors(vae: VAE, frames: NDArray[np.uint8]) -> tuple[float, float]:
    """Return the squared error of a frame, summed over pixels of 0 … 1: of V, and of the mean of all frames instead."""
    mean_image = frames.mean(axis=0) / 255
    sums = np.zeros(2)
    for start in range(0, len(frames), _BATCH):
        some = frames[start : start + _BATCH]
        seen = some / 255
        sums += [np.square(vae.decode(vae.encode(some)[0]) - seen).sum(), np.square(mean_image - seen).sum()]
    of_vae, of_mean = sums / len(frames)
    return float(of_vae), float(of_mean)


class _Network(nn.Module):
    """Encoder and decoder; frames are ``(b, 3, 64, 64)`` floats in 0 … 1."""

    def __init__(self, config: VAEConfig) -> None:
        super().__init__()
        widths, code = [3, *config.channels], config.channels[-1] * _CODE_SIDE**2
        down: list[nn.Module] = []
        up: list[nn.Module] = []
        for inner, outer in itertools.pairwise(widths):
            down += [nn.Conv2d(inner, outer, 4, stride=2, padding=1), nn.ReLU()]
            up = [nn.ReLU(), nn.ConvTranspose2d(outer, inner, 4, stride=2, padding=1), *up]
        self.encoder = nn.Sequential(*down, nn.Flatten(), nn.Linear(code, 2 * config.latent_size))
        code_shape = (config.channels[-1], _CODE_SIDE, _CODE_SIDE)
        self.decoder = nn.Sequential(nn.Linear(config.latent_size, code), nn.Unflatten(1, code_shape), *up)
        self.background: Tensor
        self.register_buffer("background", torch.zeros(3, SIDE_PX, SIDE_PX))

    def set_background(self, frames: NDArray[np.uint8]) -> None:
        """Let the decoder draw what differs from the mean of ``(n, 64, 64, 3)`` frames, which it need not learn."""
        mean_image = torch.from_numpy(frames.mean(axis=0, dtype=np.float32) / 255).permute(2, 0, 1)
        self.background.copy_(torch.logit(mean_image, eps=_LEAST_SHADE))

    def encode(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Return mean and logarithm of the variance of z, each ``(b, latent_size)``."""
        mean, log_var = self.encoder(frames).chunk(2, dim=1)
        return mean, log_var

    def decode(self, z: Tensor) -> Tensor:
        """Draw frames, as logits."""
        logits: Tensor = self.background + self.decoder(z)
        return logits


def _to_tensor(frames: NDArray[np.uint8]) -> Tensor:
    return torch.from_numpy(frames).permute(0, 3, 1, 2).float() / 255


def _check(frames: NDArray[np.uint8]) -> None:
    if frames.shape[1:] != (SIDE_PX, SIDE_PX, 3) or frames.dtype != np.uint8:
        raise DataError(f"expected RGB frames (n, {SIDE_PX}, {SIDE_PX}, 3) of uint8, got {frames.shape} {frames.dtype}")
