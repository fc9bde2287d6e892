"""Real play: rollouts of a random policy, which are the budget, and the test games (§2.6.1, steps 1 and 6)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Frame, Ints
from semrl.core.arrays import Arrays, arrays_to_ragged, ragged_to_arrays
from semrl.envs import Game, Played
from semrl.training.loop import Frames
from semrl.training.stored_play import play_again
from semrl_thesis.world_models.vae import SIDE_PX


@dataclass(frozen=True, kw_only=True)
class Rollout:
    """An episode, or the beginning of one. Its frames are not kept: it can be played again.

    Attributes
    ----------
    seed
        Of the episode.
    actions
        ``(t,)`` int64.
    rewards
        ``(t,)`` float32.
    terminated
        Whether the last decision ended the game.
    """

    seed: int
    actions: Ints
    rewards: Floats
    terminated: bool


def shrink(frame: Frame) -> Frame:
    """Scale a frame, ``(height, width, 3)`` uint8, to ``(64, 64, 3)`` by area."""
    return np.asarray(cv2.resize(frame, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def random_rollouts(
    game: Game, decisions: int, seed: int, on_frame: Callable[[int, Frame], None] = lambda _i, _frame: None
) -> list[Rollout]:
    """Play so many decisions at random; the last episode is cut short.

    Parameters
    ----------
    game
        The game.
    decisions
        Budget.
    seed
        Of the actions.
    on_frame
        Is told each decision's number and the full frame that it led to.
    """
    rng, left, rollouts = np.random.default_rng(seed), decisions, []
    while left:
        game.reset()
        rewards: list[float] = []
        over = terminated = False
        while left and not over:
            outcome = game.step(int(rng.integers(game.n_actions)))
            on_frame(decisions - left, outcome.observation.frame)
            rewards.append(outcome.reward)
            terminated, over = outcome.terminated, outcome.terminated or outcome.truncated
            left -= 1
        played = game.played
        rewarded = np.array(rewards, np.float32)
        rollouts.append(Rollout(seed=played.seed, actions=played.actions, rewards=rewarded, terminated=terminated))
    return rollouts


def frames_of(game: Game, rollout: Rollout) -> NDArray[np.uint8]:
    """Play a rollout again; return its small frames, ``(t + 1, 64, 64, 3)``."""
    again = play_again(game, Frames(), Played(seed=rollout.seed, actions=rollout.actions))
    return np.stack([shrink(step.observation.frame) for step in again])


def game_returns(game: Game, episodes: int, player: Callable[[], "Player"]) -> Iterator[float]:
    """Play whole games, each with a new player, and yield the return of each."""
    for _ in range(episodes):
        act, seen, total, over = player(), game.reset(), 0.0, False
        while not over:
            outcome = game.step(act(seen.frame))
            seen, over = outcome.observation, outcome.terminated or outcome.truncated
            total += outcome.reward
        yield total


Player = Callable[[Frame], int]
"""Chooses an action for each full frame of one game."""


def rollouts_to_arrays(rollouts: list[Rollout]) -> Arrays:
    """Write rollouts as named arrays."""
    actions = ragged_to_arrays([one.actions for one in rollouts], like=np.zeros(0, np.int64))
    rewards = ragged_to_arrays([one.rewards for one in rollouts], like=np.zeros(0, np.float32))
    return {
        "seeds": np.array([one.seed for one in rollouts], np.int64),
        "terminated": np.array([one.terminated for one in rollouts], np.bool_),
        "actions": actions["values"],
        "rewards": rewards["values"],
        "lengths": actions["lengths"],
    }


def arrays_to_rollouts(arrays: Arrays) -> list[Rollout]:
    """Read what `rollouts_to_arrays` wrote."""
    lengths = arrays["lengths"]
    actions = arrays_to_ragged({"values": arrays["actions"], "lengths": lengths})
    rewards = arrays_to_ragged({"values": arrays["rewards"], "lengths": lengths})
    return [
        Rollout(seed=int(seed), actions=acted, rewards=rewarded, terminated=bool(over))
        for seed, acted, rewarded, over in zip(arrays["seeds"], actions, rewards, arrays["terminated"], strict=True)
    ]
