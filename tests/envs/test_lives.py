"""A lost life is learned from as a loss; the score stays the game's own."""

import gymnasium as gym
import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl.envs.lives import LifeLoss


class Lives(gym.Env):
    """Pays 5 at every decision; so many lives are left after each."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, left):
        self.left = left

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros((84, 84, 3), np.uint8), {"lives": self.left[0]}

    def step(self, action):
        self.count += 1
        frame = np.full((84, 84, 3), self.count, np.uint8)
        return frame, 5, self.count == len(self.left) - 1, False, {"lives": self.left[self.count]}


def test_each_lost_life_counts_and_a_won_one_does_not():
    game = Game(LifeLoss(Lives([3, 3, 2, 3, 1, 0]), 2.0), seed=0)
    for _ in range(2):  # another episode begins with all its lives
        game.reset()
        outcomes = [game.step(0) for _ in range(5)]
        assert [one.reward for one in outcomes] == [5] * 5
        assert [one.training_reward for one in outcomes] == [5, -2, 5, -4, -2]
        assert outcomes[-1].terminated


@pytest.mark.parametrize("odd", [None, "nine", [3, 2], 2.5])
def test_other_words_for_lives_are_none(odd):
    game = Game(LifeLoss(Lives([odd, 1, odd]), 1.0), seed=0)
    game.reset()
    assert [game.step(0).training_reward for _ in range(2)] == [5, -1]


@pytest.mark.parametrize(("env", "loses"), [("BreakoutNoFrameskip-v4", True), ("PongNoFrameskip-v4", False)])
@pytest.mark.parametrize("max_frames", [1, 2])
def test_games_with_lives_lose_them(env, loses, max_frames):
    """Whoever skips the frames, and behind no-op starts."""
    config = EnvironmentConfig(max_frames=max_frames, max_noops=5)
    game, rng = Game(make_env(env, config), seed=1), np.random.default_rng(1)
    plain = Game(make_env(env, EnvironmentConfig(life_loss=0.0, max_frames=max_frames, max_noops=5)), seed=1)
    for each in (game, plain):
        each.reset()
    lost = 0
    for _ in range(400):
        action = int(rng.integers(game.n_actions))
        one, other = game.step(action), plain.step(action)
        np.testing.assert_array_equal(one.observation.frame, other.observation.frame)
        assert one.reward == other.reward == other.training_reward
        if one.training_reward != one.reward:
            assert one.training_reward == -1
            lost += 1
        if one.done:
            break
    assert lost == (5 if loses else 0)


@pytest.mark.parametrize("loss", [-1.0, float("nan"), float("inf")])
def test_a_loss_must_be_a_number_from_0_on(loss):
    with pytest.raises(UsageError, match="life_loss must lie between 0 and"):
        EnvironmentConfig(life_loss=loss)
