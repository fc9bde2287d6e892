"""M: a recurrent network that predicts z as a mixture of Gaussians, the reward and the end (§2.6.1; Bishop 1994)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, SemrlError, UsageError
from semrl.core.networks import arrays_to_module, module_to_arrays
from semrl_thesis.world_models.weights import seeded

State = tuple[Tensor, Tensor]
"""Hidden and cell state of the LSTM, each ``(b, hidden_size)``."""

_LEAST_LOG_STD = -4.0  # a component that narrows down to a point would have any likelihood
_MAX_NORM = 1.0  # of gradients


@dataclass(frozen=True, kw_only=True)
class MDNRNNConfig:
    """Shape of M, and how it learns."""

    hidden_size: int = 256
    """Length of h."""
    mixtures: int = 5
    """Gaussians of the mixture."""
    reward_weight: float = 10.0
    """What the squared error of the reward counts, against the mean negative log-likelihood of a number of z."""
    sequence_decisions: int = 32
    """Decisions through which errors are carried back."""
    updates: int = 2000
    """Mini-batches to learn from."""
    batch_size: int = 32
    """Sequences of a mini-batch."""
    learning_rate: float = 1e-3
    """Of Adam."""

    def __post_init__(self) -> None:
        if min(self.hidden_size, self.mixtures, self.sequence_decisions, self.updates, self.batch_size) < 1:
            raise UsageError(
                "hidden_size, mixtures, sequence_decisions, updates and batch_size of the MDN-RNN must all be 1 or more"
            )
        if self.reward_weight < 0 or self.learning_rate <= 0:
            raise UsageError("of the MDN-RNN reward_weight must not be below 0, and learning_rate above it")


@dataclass(frozen=True, kw_only=True)
class LatentEpisode:
    """What V made of an episode of t decisions.

    Attributes
    ----------
    means, stds
        Of z before each decision and after the last, ``(t + 1, latent_size)`` float32.
    actions
        ``(t,)`` int64.
    rewards
        ``(t,)`` float32.
    terminated
        Whether the last decision ended the game.
    """

    means: Floats
    stds: Floats
    actions: Ints
    rewards: Floats
    terminated: bool


class Prediction(NamedTuple):
    """What M predicts of the next decision; leading dimensions are those of its input."""

    log_weights: Tensor  # (..., mixtures), normalised
    means: Tensor  # (..., mixtures, latent_size)
    log_stds: Tensor  # (..., mixtures, latent_size)
    reward: Tensor  # (...)
    done_logit: Tensor  # (...)

    def log_likelihood(self, z: Tensor) -> Tensor:
        """Return the logarithm of the density of ``z``, ``(..., latent_size)``, in nats."""
        scaled = (z.unsqueeze(-2) - self.means) * torch.exp(-self.log_stds)
        each = -0.5 * scaled.square() - self.log_stds - 0.5 * math.log(2 * math.pi)
        return torch.logsumexp(self.log_weights + each.sum(dim=-1), dim=-1)

    def sample(self, temperature: float, generator: torch.Generator) -> Tensor:
        """Draw z, ``(b, latent_size)``, from a prediction of ``(b, ...)``.

        The temperature divides the logarithms of the weights and multiplies the variances (Ha & Schmidhuber, §A.2),
        as in their mixture; at 0 the likeliest component's mean is taken.
        """
        rows = torch.arange(len(self.reward))
        if not temperature:
            return self.means[rows, self.log_weights.argmax(dim=1)]
        weights = torch.softmax(self.log_weights / temperature, dim=1)
        chosen = torch.multinomial(weights, 1, generator=generator).squeeze(1)
        means, stds = self.means[rows, chosen], self.log_stds[rows, chosen].exp()
        return means + math.sqrt(temperature) * stds * torch.randn(means.shape, generator=generator)


class MDNRNN:
    """Predict what an action leads to: a density over the next z, the expected reward, the probability of the end.

    All numbers of z share the components of one mixture, so that those drawn together fit together.

    Parameters
    ----------
    config
        Its shape, and how it learns.
    latent_size
        Length of z.
    n_actions
        Number of actions.
    seed
        Of weights, mini-batches and samples.
    """

    def __init__(self, config: MDNRNNConfig, latent_size: int, n_actions: int, *, seed: int) -> None:
        self.config = config
        self.latent_size = latent_size
        self.n_actions = n_actions
        self.seed = seed
        self.network = seeded(lambda: _Network(config, latent_size, n_actions), seed)

    def fit(self, episodes: Sequence[LatentEpisode]) -> "MDNRNN":
        """Learn from sequences of random places in episodes, with z drawn anew from what V says of each frame.

        Raises
        ------
        DataError
            When no episode has a decision.
        SemrlError
            When the loss is not a number.
        """
        c, rng = self.config, np.random.default_rng(self.seed)
        draw = _Sequences(episodes, c.sequence_decisions, rng)
        optimiser = torch.optim.Adam(self.network.parameters(), lr=c.learning_rate)
        for _ in range(c.updates):
            z, actions, rewards, done, mask = draw(c.batch_size)
            predicted, _ = self.network(z[:, :-1], actions, None)
            error = -predicted.log_likelihood(z[:, 1:]) / self.latent_size
            error = error + c.reward_weight * (predicted.reward - rewards).square()
            error = error + nn.functional.binary_cross_entropy_with_logits(predicted.done_logit, done, reduction="none")
            loss = (error * mask).sum() / mask.sum()
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(self.network.parameters(), _MAX_NORM)
            optimiser.step()
        if not np.isfinite(loss.item()):
            raise SemrlError("the MDN-RNN has diverged: try a smaller learning rate")
        return self

    def begin(self, count: int) -> State:
        """Return the state in which so many episodes begin."""
        return torch.zeros(count, self.config.hidden_size), torch.zeros(count, self.config.hidden_size)

    def step(self, state: State, z: Tensor, actions: Tensor) -> tuple[Prediction, State]:
        """Predict what ``actions``, ``(b,)`` int64, lead to at ``z``, ``(b, latent_size)``, and step on."""
        with torch.inference_mode():
            predicted, (hidden, cell) = self.network(
                z[:, None], actions[:, None], (state[0][None].contiguous(), state[1][None].contiguous())
            )
            return Prediction(*(part[:, 0] for part in predicted)), (hidden[0], cell[0])

    def to_arrays(self) -> Arrays:
        """Return the weights."""
        return module_to_arrays(self.network)

    def from_arrays(self, arrays: Arrays) -> None:
        """Become what `to_arrays` was called on."""
        arrays_to_module(self.network, arrays)


class _Network(nn.Module):
    """An LSTM and a linear layer that gives everything that is predicted."""

    def __init__(self, config: MDNRNNConfig, latent_size: int, n_actions: int) -> None:
        super().__init__()
        self.n_actions, self.latent_size, self.mixtures = n_actions, latent_size, config.mixtures
        self.rnn = nn.LSTM(latent_size + n_actions, config.hidden_size, batch_first=True)
        self.head = nn.Linear(config.hidden_size, config.mixtures * (1 + 2 * latent_size) + 2)

    def forward(self, z: Tensor, actions: Tensor, state: State | None) -> tuple[Prediction, State]:
        """Go along sequences: ``z`` of ``(b, t, latent_size)``, ``actions`` of ``(b, t)``."""
        chosen = nn.functional.one_hot(actions, self.n_actions).to(z.dtype)
        hidden, state = self.rnn(torch.cat([z, chosen], dim=-1), state)
        k, d = self.mixtures, self.latent_size
        weights, means, log_stds, rest = self.head(hidden).split([k, k * d, k * d, 2], dim=-1)
        shape = (*weights.shape, d)
        log_stds = log_stds.reshape(shape).clamp(min=_LEAST_LOG_STD)
        log_weights = torch.log_softmax(weights, dim=-1)
        return Prediction(log_weights, means.reshape(shape), log_stds, rest[..., 0], rest[..., 1]), state


class _Sequences:
    """Draws mini-batches of sequences; those of short episodes are filled up, and masked."""

    def __init__(self, episodes: Sequence[LatentEpisode], length: int, rng: np.random.Generator) -> None:
        self.episodes = [one for one in episodes if len(one.actions)]
        if not self.episodes:
            raise DataError("the MDN-RNN cannot learn from no decisions")
        lengths = np.array([len(one.actions) for one in self.episodes])
        self.shares = lengths / lengths.sum()
        self.length = length
        self.rng = rng

    def __call__(self, batch: int) -> tuple[Tensor, ...]:
        """Return z ``(b, t + 1, d)``, then actions, rewards, ends and mask, each ``(b, t)``."""
        size = self.episodes[0].means.shape[1]
        z = np.zeros((batch, self.length + 1, size), np.float32)
        actions = np.zeros((batch, self.length), np.int64)
        rewards, done, mask = np.zeros((3, batch, self.length), np.float32)
        for row, i in enumerate(self.rng.choice(len(self.episodes), batch, p=self.shares)):
            one = self.episodes[i]
            start = int(self.rng.integers(max(len(one.actions) - self.length, 0) + 1))
            stop = min(start + self.length, len(one.actions))
            n = stop - start
            means, stds = one.means[start : stop + 1], one.stds[start : stop + 1]
            z[row, : n + 1] = means + stds * self.rng.standard_normal(means.shape, dtype=np.float32)
            actions[row, :n], rewards[row, :n], mask[row, :n] = one.actions[start:stop], one.rewards[start:stop], 1
            done[row, n - 1] = one.terminated and stop == len(one.actions)
        return tuple(map(torch.from_numpy, (z, actions, rewards, done, mask)))
