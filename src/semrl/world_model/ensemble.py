"""What an ensemble of models makes of scenarios: means, what they disagree about, and which are worth asking all of."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled

FEWEST_SCREENED = 8
"""Scenarios; of fewer all members are asked about all."""

Roll = Callable[[Ints, slice], tuple[NDArray[Any], Floats, Floats]]
"""Rolls ``(s, t)`` sequences forward in some members: what the first of them predicts, ``(s, t, …)``, and
``(members, s, t)`` rewards and ``(members, s)`` values."""


class Imagined(NamedTuple):
    """What was imagined, of all sequences or the best quarter of them."""

    sequences: Ints
    predicted: NDArray[Any]
    rewards: Floats
    """``(s, t)``, means."""
    values: Floats
    """``(s,)``, means."""
    uncertainties: Floats
    """``(s,)``, standard deviation of the discounted return."""


def imagine_all(roll: Roll, sequences: Ints, *, members: int, screening: int, discount: float) -> Imagined:
    """Ask some members about all sequences, the others about the best quarter; where none screen, all about all."""
    screened = 0 < screening < members and len(sequences) >= FEWEST_SCREENED
    predicted, rewards, values = roll(sequences, slice(screening if screened else None))
    if screened:
        best = _best(_returns(rewards, values, discount), len(sequences) // 4)
        sequences = sequences[best]
        _, more_rewards, more_values = roll(sequences, slice(screening, None))
        predicted = predicted[best]
        rewards = np.concatenate([rewards[:, best], more_rewards])
        values = np.concatenate([values[:, best], more_values])
    return Imagined(sequences, predicted, *_averaged(rewards, values, _returns(rewards, values, discount)))


@compiled
def _best(returns: NDArray[np.float64], count: int) -> Ints:
    """Return the scenarios of which ``(members, s)`` returns are best on average, ascending; of equal ones the first.

    Sums here and in `_averaged` are taken member by member, as numpy does.
    """
    means = np.zeros(returns.shape[1])
    for member in range(len(returns)):
        means -= returns[member]
    best: Ints = np.sort(np.argsort(means / len(returns), kind="mergesort")[:count])
    return best


@compiled
def _averaged(rewards: Floats, values: Floats, returns: NDArray[np.float64]) -> tuple[Floats, Floats, Floats]:
    """Return mean rewards, ``(s, t)``, mean values, ``(s,)``, and the standard deviation of the returns, ``(s,)``."""
    members, n, length = rewards.shape
    mean_rewards, mean_values = np.zeros((n, length), np.float32), np.zeros(n, np.float32)
    means, squares = np.zeros(n), np.zeros(n)
    for member in range(members):
        mean_rewards += rewards[member]
        mean_values += values[member]
        means += returns[member]
    means /= members
    for member in range(members):
        for s in range(n):
            squares[s] += (returns[member, s] - means[s]) ** 2
    count = np.float32(members)
    return mean_rewards / count, mean_values / count, np.sqrt(squares / members).astype(np.float32)


def _returns(rewards: Floats, values: Floats, discount: float) -> NDArray[np.float64]:
    """Return what each member makes of each scenario, ``(members, s)``."""
    length = rewards.shape[2]
    weights = discount ** np.arange(length)
    return np.asarray((rewards * weights).sum(axis=2) + discount**length * values)


def is_due(seen: int, newest: int, *, first: int, fewest: int, share: float) -> bool:
    """Tell whether there is enough new to grow a member anew.

    Parameters
    ----------
    seen, newest
        Decisions seen, and those that the newest member was grown from; 0 before there is one.
    first
        Decisions before the first growth.
    fewest, share
        Fewest new decisions, and the same as a share of those of the newest.
    """
    return seen >= first if not newest else seen - newest >= max(fewest, share * newest)
