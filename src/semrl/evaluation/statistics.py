"""Means that a few lucky runs do not decide, their intervals, and performance profiles (Agarwal et al. 2021)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import trim_mean

Floats = NDArray[np.float64]

RESAMPLES = 2000
"""Draws of each bootstrap."""

TAILS = (0.025, 0.975)
"""Quantiles of a 95 % interval."""


def interquartile_mean(runs: Sequence[Floats]) -> tuple[float, float | None, float | None]:
    """Return the mean of all returns but the lowest and the highest quarter, and its 95 % interval.

    The bootstrap draws runs anew, and within each of them episodes (after Agarwal et al., "Deep reinforcement learning
    at the edge of the statistical precipice", NeurIPS 2021). Of one run it draws the episodes alone, so that it says
    nothing of other seeds; of one episode there is no interval.
    """
    if sum(map(len, runs)) < 2:
        return _middle(runs), None, None
    rng = np.random.default_rng(0)
    drawn = [
        _middle([rng.choice(runs[run], len(runs[run])) for run in rng.integers(len(runs), size=len(runs))])
        for _ in range(RESAMPLES)
    ]
    low, high = np.quantile(drawn, TAILS)
    return _middle(runs), float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Which share of runs scores more than a threshold."""

    thresholds: Floats
    """``(n,)``, rising."""
    share: Floats
    """``(n,)``, falling from 1 to 0."""
    low: Floats
    high: Floats
    """``(n,)``, ends of its pointwise 95 % interval."""


def performance_profile(games: Sequence[Floats], thresholds: Floats) -> Profile:
    """Return the performance profile of an agent.

    Parameters
    ----------
    games
        For each game ``(runs,)``, one score a run, in one unit. Every game counts alike.
    thresholds
        ``(n,)``, rising.
    """
    rng = np.random.default_rng(0)
    drawn = [_above([rng.choice(game, len(game)) for game in games], thresholds) for _ in range(RESAMPLES)]
    low, high = np.quantile(drawn, TAILS, axis=0)
    return Profile(thresholds=thresholds, share=_above(games, thresholds), low=low, high=high)


def _above(games: Sequence[Floats], thresholds: Floats) -> Floats:
    """Return ``(n,)``, the share of runs above each threshold, averaged over games."""
    shares: Floats = np.mean([(game[:, None] > thresholds).mean(axis=0) for game in games], axis=0)
    return shares


def _middle(runs: Sequence[Floats]) -> float:
    return float(trim_mean(np.concatenate(runs), 0.25))
