"""Small worlds whose next state is known, to learn and to test on."""

import numpy as np

from semrl.core import Trajectory, Transitions

N_ACTIONS = 3


def transitions(states, previous, actions, next_states, rewards=None):
    return Transitions(
        states=states.astype(np.float32),
        previous=previous.astype(np.float32),
        actions=actions,
        rewards=np.zeros(len(states), np.float32) if rewards is None else rewards.astype(np.float32),
        next_states=next_states.astype(np.float32),
    )


def linear(count, seed=0, dimension=4):
    """A state that turns, keeps some of its speed and is pushed by actions."""
    system, rng = np.random.default_rng(99), np.random.default_rng(seed)
    turn = np.linalg.qr(system.normal(size=(dimension, dimension)))[0]
    push = system.normal(size=(N_ACTIONS, dimension))
    states = rng.normal(size=(count, dimension))
    previous = states + 0.5 * rng.normal(size=states.shape)
    actions = rng.integers(N_ACTIONS, size=count)
    return transitions(states, previous, actions, states @ turn + 0.5 * (states - previous) + push[actions])


def ball(count, seed=0, size=10.0, speed=0.3):
    """A ball that flies straight on and bounces off four walls, and a bat that actions move down, not at all, up."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, size, size=(count, 2))
    angles = rng.uniform(0, 2 * np.pi, count)
    velocity = speed * np.column_stack([np.cos(angles), np.sin(angles)])
    after = places + velocity
    after = np.where(after < 0, -after, np.where(after > size, 2 * size - after, after))
    bats, actions = rng.uniform(0, size, size=(count, 1)), rng.integers(N_ACTIONS, size=count)
    moved = np.clip(bats + speed * (actions[:, None] - 1), 0, size)
    now = np.column_stack([places, bats])
    return transitions(now, np.column_stack([places - velocity, bats]), actions, np.column_stack([after, moved]))


def explained(predicted, targets):
    """Share of the variance explained, at worst over all columns."""
    return float(np.min(1 - np.mean((predicted - targets) ** 2, axis=0) / np.var(targets, axis=0)))


def walk(decisions, seed=0, dimension=3, rare=0.3):
    """An episode at random, with gains and losses here and there."""
    rng = np.random.default_rng(seed)
    return Trajectory(
        states=np.cumsum(rng.normal(size=(decisions + 1, dimension)), axis=0).astype(np.float32),
        actions=rng.integers(N_ACTIONS, size=decisions),
        rewards=rng.choice([-1, 0, 1], p=[rare / 2, 1 - rare, rare / 2], size=decisions).astype(np.float32),
    )


def copied(part):
    """Return the state as it is now, whatever becomes of the part."""
    return {name: array.copy() for name, array in part.to_arrays().items()}
