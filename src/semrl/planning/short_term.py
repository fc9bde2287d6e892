"""Short-term planning (§3.4.3): which sequences of actions are rolled forward through the model of the world."""

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from semrl.core import Ints
from semrl.core.errors import UsageError

MAX_SCENARIOS = 4096
_POOL = 64  # decisions until the same drawn sequences come again
_TURNS = 6  # most stretches of a drawn sequence
_LONGEST_CHANGE = 0.5  # share of a sequence


@dataclass(frozen=True, kw_only=True, slots=True)
class ShortTermConfig:
    """Settings of `action_sequences`."""

    depth: int = 5
    """Actions of a scenario."""
    scenarios: int = 0
    """Sequences that are tried, drawn at random with few changes of action (random shooting); 0: all there are."""
    warm_start_fraction: float = 0.25
    """Of drawn sequences: share that begins like the plan before, the first of which is that plan."""
    refined: int = 0
    """Sequences of a second round in episodes that are not learned from: the best of the first, with a stretch of each
    drawn anew; 0: none."""
    elites: int = 8
    """How many are the best."""

    def __post_init__(self) -> None:
        if self.depth < 1:
            raise UsageError(f"scenarios.depth must be 1 or more, not {self.depth}")
        if not 0 <= self.scenarios <= MAX_SCENARIOS:
            raise UsageError(f"scenarios.scenarios must lie in 0 … {MAX_SCENARIOS:,}, not {self.scenarios}")
        if not 0 <= self.refined <= MAX_SCENARIOS:
            raise UsageError(f"scenarios.refined must lie in 0 … {MAX_SCENARIOS:,}, not {self.refined}")
        if self.elites < 1:
            raise UsageError(f"scenarios.elites must be 1 or more, not {self.elites}")
        if not 0 <= self.warm_start_fraction <= 1:
            raise UsageError(f"scenarios.warm_start_fraction must lie in 0 … 1, not {self.warm_start_fraction}")


def action_sequences(n_actions: int, config: ShortTermConfig, *, number: int = 0, proposed: Ints | None = None) -> Ints:
    """Return the sequences of actions to be tried at a decision, ``(s, depth)`` int64.

    Parameters
    ----------
    n_actions
        Number of actions.
    config
        How many, and how long.
    number
        Of the decision: others are drawn at the next one. It decides alone, so a plan can be made again.
    proposed
        ``(t,)``, what is left of the plan before; None or empty where there was none.

    Raises
    ------
    UsageError
        When all were asked for and they are more than 4,096.
    """
    if not config.scenarios:
        return _all_sequences(n_actions, config.depth)
    drawn, kept = _drawn_sequences(n_actions, config)
    turn = slice(number % _POOL * config.scenarios, (number % _POOL + 1) * config.scenarios)
    if proposed is None or not len(proposed):
        return drawn[turn].copy()  # what may not be written to would be another type to compiled code
    plan = np.append(proposed, np.full(max(config.depth - len(proposed), 0), proposed[-1]))[: config.depth]
    sequences: Ints = np.where(np.arange(config.depth) < kept[turn, None], plan, drawn[turn])
    return sequences


def refined_sequences(best: Ints, n_actions: int, config: ShortTermConfig, *, number: int = 0) -> Ints:
    """Return the sequences of a second round, ``(refined, depth)`` int64.

    Each is one of the best, in turn, with a stretch of up to half its length drawn anew: rolling horizon evolution
    (Perez et al., GECCO 2013).

    Parameters
    ----------
    best
        ``(k, depth)``, the best first.
    n_actions, config
        As for `action_sequences`.
    number
        Of the decision; it decides which changes are drawn.
    """
    drawn, begins, ends = _drawn_changes(n_actions, config)
    turn = slice(number % _POOL * config.refined, (number % _POOL + 1) * config.refined)
    time = np.arange(config.depth)
    anew = (begins[turn, None] <= time) & (time < ends[turn, None])
    sequences: Ints = np.where(anew, drawn[turn], best[np.arange(config.refined) % len(best)])
    return sequences


@lru_cache(maxsize=16)
def _all_sequences(n_actions: int, depth: int) -> Ints:
    """Return all sequences, ``(n_actions ** depth, depth)``, in ascending order."""
    if n_actions ** min(depth, MAX_SCENARIOS.bit_length()) > MAX_SCENARIOS:  # more could not even be counted
        raise UsageError(
            f"{n_actions} actions make more than {MAX_SCENARIOS:,} scenarios of depth {depth}; "
            "choose a smaller scenarios.depth, or how many are tried with scenarios.scenarios"
        )
    sequences: Ints = np.array(list(itertools.product(range(n_actions), repeat=depth)), dtype=np.int64)
    sequences.flags.writeable = False  # it is shared by all callers
    return sequences


@lru_cache(maxsize=16)
def _drawn_sequences(n_actions: int, config: ShortTermConfig) -> tuple[Ints, Ints]:
    """Draw a pool of sequences, ``(k, depth)``, and how much of the plan before each keeps, ``(k,)``."""
    rng = np.random.default_rng(0)
    count, depth = _POOL * config.scenarios, config.depth
    drawn = _stretches(n_actions, (count, depth), rng)
    place = np.arange(count) % config.scenarios
    kept = np.where(place < config.warm_start_fraction * config.scenarios, rng.integers(depth, size=count), 0)
    kept[(place == 0) & (config.warm_start_fraction > 0)] = depth
    return _shared(drawn), _shared(kept)


@lru_cache(maxsize=16)
def _drawn_changes(n_actions: int, config: ShortTermConfig) -> tuple[Ints, Ints, Ints]:
    """Draw a pool of what refines sequences, ``(k, depth)``, and where each change begins and ends, ``(k,)``."""
    rng = np.random.default_rng(1)
    count, depth = _POOL * config.refined, config.depth
    drawn = _stretches(n_actions, (count, depth), rng)
    longest = max(int(_LONGEST_CHANGE * depth), 1)
    begins = rng.integers(1 - longest, depth, size=count)  # before the first decision, or few would change it
    ends = begins + rng.integers(1, longest + 1, size=count)
    return _shared(drawn), _shared(begins), _shared(ends)


def _stretches(n_actions: int, shape: tuple[int, int], rng: np.random.Generator) -> Ints:
    """Draw sequences, ``(k, depth)``, each of a few stretches of random length.

    In most of them an action is held; in some two take turns, which keeps a thing in place that can only be pushed one
    way or the other.
    """
    count, depth = shape
    ends = np.cumsum(rng.integers(1, depth + 1, size=(count, _TURNS)), axis=1)
    stretch = np.minimum((np.arange(depth)[None, :, None] >= ends[:, None, :]).sum(axis=2), _TURNS - 1)
    held = rng.integers(n_actions, size=(count, _TURNS))
    other = np.where(rng.random((count, _TURNS)) < 0.3, rng.integers(n_actions, size=(count, _TURNS)), held)
    rows = np.arange(count)[:, None]
    drawn: Ints = np.where(np.arange(depth) % 2, other[rows, stretch], held[rows, stretch])
    return drawn


def _shared(drawn: Ints) -> Ints:
    """Return what all callers share, who cannot change it."""
    drawn.flags.writeable = False
    return drawn
