"""C: a linear policy on z and h (§2.6.1), and the evolution strategy that finds its weights (CMA-ES, Hansen 2016)."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, MissingExtraError, UsageError

Parameters = NDArray[np.float64]
"""Weights and offsets of one controller, ``(n,)``, or of several, ``(p, n)``."""


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """How CMA-ES looks for C."""

    population: int = 32
    """Candidates of a generation."""
    generations: int = 100
    """Generations."""
    initial_std: float = 0.5
    """Deviation of the first generation's weights from 0."""
    dreams: int = 16
    """Dreams in which each candidate is tested; Ha & Schmidhuber use 16."""

    def __post_init__(self) -> None:
        if self.population < 2 or self.generations < 1 or self.dreams < 1 or self.initial_std <= 0:
            raise UsageError(
                "the controller needs a population of 2 or more, generations and dreams of 1 or more "
                "and an initial_std above 0"
            )


class LinearController:
    """Choose the action with the greatest number of ``W [z h] + b``.

    Parameters
    ----------
    n_features
        Length of z and h together.
    n_actions
        Number of actions.

    Examples
    --------
    >>> controller = LinearController(2, 3)
    >>> controller.parameters = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    >>> controller.act(np.array([[2.0, 1.0], [0.0, 1.0], [0.0, 0.0]])).tolist()
    [0, 1, 2]
    """

    def __init__(self, n_features: int, n_actions: int) -> None:
        self.n_features = n_features
        self.n_actions = n_actions
        self.parameters: Parameters = np.zeros(parameter_count(n_features, n_actions))

    def act(self, features: Floats | Parameters) -> Ints:
        """Return an action for each row of ``(b, n_features)``, ``(b,)`` int64."""
        weights, offsets = split(self.parameters, self.n_features, self.n_actions)
        return np.asarray((features @ weights.T + offsets).argmax(axis=-1), dtype=np.int64)

    def to_arrays(self) -> Arrays:
        """Return the parameters."""
        return {"parameters": self.parameters}

    def from_arrays(self, arrays: Arrays) -> None:
        """Become what `to_arrays` was called on.

        Raises
        ------
        DataError
            When these are the parameters of another shape.
        """
        if arrays["parameters"].shape != self.parameters.shape:
            raise DataError(f"a controller of {self.parameters.shape} cannot take {arrays['parameters'].shape} numbers")
        self.parameters = arrays["parameters"].copy()


def parameter_count(n_features: int, n_actions: int) -> int:
    """Return how many numbers a controller has."""
    return (n_features + 1) * n_actions


def split(parameters: Parameters, n_features: int, n_actions: int) -> tuple[Parameters, Parameters]:
    """Return weights, ``(..., n_actions, n_features)``, and offsets, ``(..., n_actions)``."""
    shape = (*parameters.shape[:-1], n_actions, n_features)
    return parameters[..., : n_actions * n_features].reshape(shape), parameters[..., n_actions * n_features :]


def evolve(
    returns: Callable[[Parameters, int], NDArray[np.float64]], n: int, config: ControllerConfig, *, seed: int
) -> tuple[Parameters, NDArray[np.float64]]:
    """Look for the parameters that return most.

    Parameters
    ----------
    returns
        Given a generation, ``(population, n)``, and its number, tells what each candidate returns, ``(population,)``.
    n
        Number of parameters.
    config
        How to look.
    seed
        Of the candidates; NumPy's global generator stays as it was.

    Returns
    -------
    The mean of the last generation's distribution, ``(n,)``: where returns are noisy, the best candidate was only
    lucky. And the mean return of each generation, ``(generations,)``.

    Raises
    ------
    MissingExtraError
        When the package cma is not installed.
    """
    try:
        import cma
    except ImportError:
        raise MissingExtraError("thesis", "the controller of World Models") from None
    rng = np.random.default_rng(seed)
    options = {
        "popsize": config.population,
        "randn": lambda *shape: rng.standard_normal(shape),
        "seed": math.nan,  # leaves the global generator alone
        "verbose": -9,
    }
    search = cma.CMAEvolutionStrategy(np.zeros(n), config.initial_std, options)
    history = []
    for generation in range(config.generations):
        candidates = np.stack(search.ask())
        reached = returns(candidates, generation)
        search.tell(list(candidates), list(-reached))
        history.append(reached.mean())
    return np.array(search.result.xfavorite), np.array(history)
