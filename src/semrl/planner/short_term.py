"""Short-term planning (§3.4.3): every sequence of actions, rolled forward through the models."""

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from semrl.errors import UsageError
from semrl.protocols import DynamicsModel, RewardModel
from semrl.types import Floats, Ints, Scenarios

MAX_SCENARIOS = 4096


@dataclass(frozen=True, kw_only=True, slots=True)
class ShortTermConfig:
    """Settings of `imagine`."""

    depth: int = 5
    """Actions of a scenario; all sequences of this length are tried."""
    hold_decisions: int = 1
    """Decisions for which each of them is repeated."""

    def __post_init__(self) -> None:
        if self.depth < 1 or self.hold_decisions < 1:
            raise UsageError("short_term.depth and hold_decisions must be 1 or more")


@lru_cache(maxsize=16)
def action_sequences(n_actions: int, config: ShortTermConfig) -> Ints:
    """Return all sequences of actions, ``(n_actions ** depth, depth * hold_decisions)`` int64, in ascending order.

    Raises
    ------
    UsageError
        When they are more than 4,096.
    """
    if n_actions ** min(config.depth, MAX_SCENARIOS.bit_length()) > MAX_SCENARIOS:  # more could not even be counted
        raise UsageError(
            f"{n_actions} actions make more than {MAX_SCENARIOS:,} scenarios of depth {config.depth}; "
            "choose a smaller short_term.depth"
        )
    chosen = np.array(list(itertools.product(range(n_actions), repeat=config.depth)), dtype=np.int64)
    sequences: Ints = np.repeat(chosen, config.hold_decisions, axis=1)
    sequences.flags.writeable = False  # it is shared by all callers
    return sequences


def imagine(
    state: Floats, previous: Floats, sequences: Ints, dynamics: DynamicsModel, reward: RewardModel
) -> Scenarios:
    """Roll sequences of actions forward, all at once (§3.4.3).

    Parameters
    ----------
    state, previous
        ``(d,)`` float32, where they begin and the state before.
    sequences
        ``(s, t)`` int64 actions.
    dynamics, reward
        The models.
    """
    n, length = sequences.shape
    states = np.empty((n, length + 2, len(state)), np.float32)  # the previous state, this one, and those to come
    states[:, 0], states[:, 1] = previous, state
    for t in range(length):
        states[:, t + 2] = dynamics.predict(states[:, t + 1], states[:, t], sequences[:, t])
    now, before = (part.reshape(n * length, len(state)) for part in (states[:, 1:-1], states[:, :-2]))
    rewards = reward.predict(now, before, sequences.ravel()).reshape(n, length)
    return Scenarios(actions=sequences, states=states[:, 2:], rewards=rewards)
