"""Putting a batch together from the ring of a replay buffer: one compiled pass in place of some forty calls."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled


class Ring(NamedTuple):
    """What is remembered of each of ``c`` entries; see `semrl.agents.replay.ReplayBuffer`."""

    observations: NDArray[Any]
    """``(c, k)``, each in one row."""
    plans: Floats
    """``(c, p)`` float32."""
    actions: NDArray[np.int16]
    """``(c,)``, −1 at the end of an episode."""
    advised: NDArray[np.int16]
    rewards: NDArray[np.float32]
    terminated: NDArray[np.bool_]
    starts: NDArray[np.bool_]


class Drawn(NamedTuple):
    """Room for a batch of ``b`` transitions over ``n`` steps."""

    states: NDArray[Any]
    """``(2 b, k)``, each an observation and the one before it."""
    next_states: NDArray[Any]
    plans: Floats
    next_plans: Floats
    actions: Ints
    advised: Ints
    rewards: NDArray[np.float32]
    """``(b, n)``, discounted, 0 after the end."""
    discounts: NDArray[np.float32]
    """``(b,)``."""


@compiled
def gather(ring: Ring, ticks: Ints, span: tuple[int, int], gammas: NDArray[np.float32], drawn: Drawn) -> None:
    """Write the transitions that begin at some ticks, the numbers of entries as they were written.

    Parameters
    ----------
    ring
        What is remembered.
    ticks
        ``(b,)``, where the transitions begin.
    span
        The oldest tick and the newest.
    gammas
        ``(n + 1,)``, what a reward counts after so many steps.
    drawn
        Is filled.
    """
    observations, plans, actions, advised, rewards, terminated, starts = ring
    states, next_states, plans_now, plans_next = drawn.states, drawn.next_states, drawn.plans, drawn.next_plans
    capacity, steps = len(actions), len(gammas) - 1
    for b in range(len(ticks)):
        tick, length, ended = ticks[b], 0, False
        drawn.rewards[b] = 0
        while length < steps and not ended:
            entry = (tick + length) % capacity
            if tick + length >= span[1] or actions[entry] < 0:
                break
            drawn.rewards[b, length] = rewards[entry] * gammas[length]
            ended = terminated[entry]
            length += 1
        drawn.discounts[b] = np.float32(0) if ended else gammas[length]
        entry = tick % capacity
        drawn.actions[b], drawn.advised[b] = actions[entry], advised[entry]
        following = tick if ended else tick + length  # after the end any entry will do: it counts 0
        _copy(plans, entry, plans_now, b)
        _copy(plans, following % capacity, plans_next, b)
        _stack(observations, starts, tick, span[0], states, 2 * b)
        _stack(observations, starts, following, span[0], next_states, 2 * b)


@compiled
def stack(ring: Ring, ticks: Ints, oldest: int, states: NDArray[Any]) -> None:
    """Write the states at some ticks, two rows each: an observation and the one before it.

    Parameters
    ----------
    ring
        What is remembered.
    ticks
        ``(b,)``.
    oldest
        The first tick that is remembered.
    states
        ``(2 b, k)``, is filled.
    """
    for b in range(len(ticks)):
        _stack(ring.observations, ring.starts, ticks[b], oldest, states, 2 * b)


@compiled
def _stack(  # noqa: PLR0917 - compiled functions take no keywords
    observations: NDArray[Any], starts: NDArray[np.bool_], tick: int, oldest: int, states: NDArray[Any], at: int
) -> None:
    """Put an observation and the one before it in two rows; itself again at the start of an episode."""
    entry = tick % len(starts)
    before = entry if starts[entry] or tick == oldest else (tick - 1) % len(starts)
    _copy(observations, entry, states, at)
    _copy(observations, before, states, at + 1)


@compiled
def _copy(rows: NDArray[Any], entry: int, into: NDArray[Any], at: int) -> None:
    """Copy one row: number by number, which costs less than to make views of rows this short."""
    for i in range(rows.shape[1]):
        into[at, i] = rows[entry, i]
