"""The dream: M as a virtual environment in which C is tried, without a frame of real play (§2.6.1, step 5)."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semrl.core.errors import UsageError
from semrl_thesis.world_models.controller import Parameters, split
from semrl_thesis.world_models.mdn_rnn import LatentEpisode, Prediction, State


@dataclass(frozen=True, kw_only=True)
class DreamConfig:
    """How C is tried in M."""

    temperature: float = 1.0
    """Of what is drawn from M: above 1 dreams are harder to predict, so that C cannot profit from M's errors."""
    horizon_decisions: int = 50
    """Decisions of a dream, if it does not end before."""
    starts: int = 1000
    """Moments of real play, drawn at random, at which dreams begin."""

    def __post_init__(self) -> None:
        if self.temperature < 0:
            raise UsageError(f"the temperature of dreams must be 0 or more, not {self.temperature}")
        if min(self.horizon_decisions, self.starts) < 1:
            raise UsageError("horizon_decisions and starts of dreams must both be 1 or more")


class Model(Protocol):
    """What is dreamt with: `MDNRNN`, or another."""

    n_actions: int

    def begin(self, count: int) -> State: ...  # noqa: D102

    def step(self, state: State, z: Tensor, actions: Tensor) -> tuple[Prediction, State]: ...  # noqa: D102


class Dream:
    """Many dreams side by side; what is called is Gymnasium's, with a row for each dream.

    Parameters
    ----------
    model
        Predicts.
    z, state
        Of the moments at which dreams may begin, ``(n, latent_size)`` and two of ``(n, hidden_size)``.
    config
        How it is dreamt.
    """

    def __init__(self, model: Model, z: Tensor, state: State, config: DreamConfig) -> None:
        self.model = model
        self.config = config
        self.starts = z, state
        self._generator = torch.Generator()
        self._z, self._state = z, state
        self._alive = torch.ones(len(z))

    def reset(self, count: int, *, seed: int, copies: int = 1) -> Tensor:
        """Begin `copies` times the same `count` dreams; return what C sees, ``(copies * count, latent + hidden)``."""
        z, (hidden, cell) = self.starts
        self._generator.manual_seed(seed)
        chosen = torch.randint(len(z), (count,), generator=self._generator).repeat(copies)
        self._z, self._state = z[chosen], (hidden[chosen], cell[chosen])
        self._alive = torch.ones(len(chosen))
        return self._features()

    def step(self, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Dream one decision on.

        Returns
        -------
        What C sees; the rewards, ``(b,)``, of dreams that had not ended; and which have ended, ``(b,)`` bool.
        """
        predicted, self._state = self.model.step(self._state, self._z, actions)
        self._z = predicted.sample(self.config.temperature, self._generator)
        rewards = predicted.reward * self._alive
        ends = torch.rand(len(actions), generator=self._generator) < torch.sigmoid(predicted.done_logit)
        self._alive = self._alive * ~ends
        return self._features(), rewards, self._alive == 0

    def returns(self, parameters: Parameters, count: int, *, seed: int) -> NDArray[np.float64]:
        """Return what each controller, of ``(p, n)`` parameters, gains in `count` dreams that are the same for all.

        Returns
        -------
        ``(p,)``, the mean sum of rewards of a dream.
        """
        p = len(parameters)
        features = self.reset(count, seed=seed, copies=p)
        weights, offsets = map(torch.from_numpy, split(parameters, features.shape[1], self.model.n_actions))
        weights, offsets = weights.float(), offsets.float()[:, None]
        total = torch.zeros(p * count)
        for _ in range(self.config.horizon_decisions):
            values = features.reshape(p, count, -1) @ weights.transpose(1, 2) + offsets
            features, rewards, over = self.step(values.argmax(dim=2).flatten())
            total += rewards
            if bool(over.all()):
                break
        return np.asarray(total.reshape(p, count).mean(dim=1).numpy(), dtype=np.float64)

    def _features(self) -> Tensor:
        return torch.cat([self._z, self._state[0]], dim=1)


def moments(model: Model, episodes: list[LatentEpisode], count: int, *, seed: int) -> tuple[Tensor, State]:
    """Draw moments of real play, with the state that M was in: where dreams begin.

    Parameters
    ----------
    model
        Goes along the episodes.
    episodes
        Real play.
    count
        How many moments, at most all there are.
    seed
        Of the choice.

    Returns
    -------
    Mean z, ``(count, latent_size)``, and M's state before it saw that, twice ``(count, hidden_size)``.
    """
    lengths = np.array([len(one.actions) for one in episodes])
    rng = np.random.default_rng(seed)
    chosen = set(rng.choice(lengths.sum(), min(count, int(lengths.sum())), replace=False).tolist())
    kept: list[tuple[Tensor, Tensor, Tensor]] = []
    passed = 0
    for one in episodes:
        state = model.begin(1)
        z, actions = torch.from_numpy(one.means), torch.from_numpy(one.actions)
        for i in range(len(actions)):
            if passed + i in chosen:
                kept.append((z[i : i + 1], *state))
            _, state = model.step(state, z[i : i + 1], actions[i : i + 1])
        passed += len(actions)
    z, hidden, cell = (torch.cat(parts) for parts in zip(*kept, strict=True))
    return z, (hidden, cell)
