"""The networks of the agent (Fig. 3.8): convolutions for images, a dense layer alone for vectors."""

import torch
from torch import Tensor, nn

from semrl.agents.config import NetworkConfig
from semrl.core.networks import dense

LEAST_INPUT_DEVIATION = 0.5
"""Smallest deviation that is divided by, as a share of the root mean square over all numbers."""


class StateInput(nn.Module):
    """Turn (current, previous) observations into (current, difference), §3.3.

    Bytes are divided by 255. Vectors may be normalised; mean and scale are set once, by `fit`.
    """

    def __init__(self, shape: tuple[int, ...], *, is_image: bool) -> None:
        super().__init__()
        self.is_image = is_image
        self.unit = 1 / 255 if is_image else 1.0
        size = () if is_image else (2, *shape)
        self.mean: Tensor
        self.scale: Tensor
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("scale", torch.ones(size))

    def fit(self, states: Tensor, plans: Tensor) -> None:
        """Measure mean and standard deviation of every number of the states, ``(b, 2, d)``; images stay as they are.

        Plans, ``(b, p)``, are not normalised, but they count towards the usual deviation, which bounds that of a
        number that hardly varied (docs/trials.md, "The least deviation of an input").
        """
        if self.is_image:
            return
        x = self._differences(states)
        self.mean.copy_(x.mean(dim=0))
        deviation = x.std(dim=0, correction=0)  # (2, d)
        # What hardly varied in the sample may vary later: dividing by almost nothing would blow it up.
        of_plans = (plans - plans.mean(dim=0)).square().mean(dim=0).sqrt()  # without a warning where there are none
        of_all = torch.stack([torch.cat([deviation[0], of_plans]), torch.cat([deviation[1], 0 * of_plans])])
        least = LEAST_INPUT_DEVIATION * of_all.square().mean(dim=1, keepdim=True).sqrt()
        deviation = torch.maximum(deviation, least)
        self.scale.copy_(torch.where(deviation > 0, 1 / deviation, torch.ones_like(deviation)))

    def forward(self, states: Tensor) -> Tensor:
        """Map ``(b, 2, *shape)`` of bytes or floats to ``(b, 2, *shape)`` float32."""
        return (self._differences(states) - self.mean) * self.scale

    def _differences(self, states: Tensor) -> Tensor:
        x = states.float() * self.unit
        return torch.stack([x[:, 0], x[:, 0] - x[:, 1]], dim=1)


class FourierFeatures(nn.Module):
    """Append sines and cosines of a state and its difference, at doubling frequencies from 1 radian a unit on.

    Dense layers learn slowly what changes fast with a coordinate; of these features it is a smooth function
    (Tancik et al., "Fourier features let networks learn high frequency functions in low dimensional domains",
    NeurIPS 2020).
    """

    def __init__(self, frequencies: int) -> None:
        super().__init__()
        self.factors: Tensor
        self.register_buffer("factors", 2.0 ** torch.arange(frequencies), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """Map ``(b, 2, d)`` to ``(b, 2 * d + 4 * d * frequencies)``."""
        angles = (x[:, :, :, None] * self.factors).flatten(1)
        return torch.cat([x.flatten(1), angles.sin(), angles.cos()], dim=1)


class QNetwork(nn.Module):
    """The Q-network: of a state, its difference to the one before, and the features of a plan, to action values.

    Parameters
    ----------
    shape
        ``(84, 84)`` for images, ``(d,)`` for vectors.
    n_values
        Number of outputs.
    config
        Widths and input.
    seed
        Of the initial weights; PyTorch's global generator stays as it was.
    plan_size
        Features of a plan, which the dense layers are given beside the state; 0 where there is no planner.
    """

    def __init__(
        self, shape: tuple[int, ...], n_values: int, config: NetworkConfig, *, seed: int, plan_size: int = 0
    ) -> None:
        super().__init__()
        is_image = len(shape) > 1
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.state_input = StateInput(shape, is_image=is_image)
            self.body, width = _convolutions() if is_image else _flat(shape[0], config.frequencies)
            self.dense = dense(width + plan_size, config.hidden_units, n_values, layer_norm=config.layer_norm)

    def forward(self, states: Tensor, plans: Tensor) -> Tensor:
        """Map states, ``(b, 2, *shape)`` of bytes or floats, and plans, ``(b, p)``, to ``(b, n_values)``."""
        values: Tensor = self.dense(torch.cat([self.body(self.state_input(states)), plans], dim=1))
        return values


def _flat(size: int, frequencies: int) -> tuple[nn.Module, int]:
    """Return the layer that lays a vector and its difference out, and the number of values it gives."""
    if not frequencies:
        return nn.Flatten(), 2 * size
    return FourierFeatures(frequencies), 2 * size + 4 * size * frequencies


def _convolutions() -> tuple[nn.Module, int]:
    """Return the three convolutions of Fig. 3.8 and the number of values they give."""
    layers = [
        nn.Conv2d(2, 32, 8, stride=4), nn.ReLU(),  # 84 → 20
        nn.Conv2d(32, 64, 8, stride=4), nn.ReLU(),  # 20 → 4
        nn.Conv2d(64, 64, 3, stride=1), nn.ReLU(),  # 4 → 2
        nn.Flatten(),
    ]  # fmt: skip
    return nn.Sequential(*layers), 2 * 2 * 64
