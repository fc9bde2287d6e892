"""A reward that nothing can be learned from is the environment's fault, and told as such."""

import gymnasium as gym
import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs import Game
from semrl.envs.game import LARGEST_REWARD
from semrl.training import RunFolder


class Paying(gym.Env):
    """Pays 1, and something else at its fourth decision."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, odd=float("nan")):
        self.odd = odd

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros((84, 84, 3), np.uint8), {}

    def step(self, action):
        self.count += 1
        frame = np.full((84, 84, 3), self.count, np.uint8)
        return frame, self.odd if self.count == 4 else 1, self.count == 9, False, {}


ODD = [float("nan"), float("inf"), float("-inf"), 1e39, -1e39, np.float32("nan"), None, "many", [1.0, 2.0]]


@pytest.mark.parametrize("odd", ODD, ids=str)
def test_the_reward_and_the_decision_are_named(odd):
    game = Game(Paying(odd), seed=0)
    game.reset()
    assert [game.step(0).reward for _ in range(3)] == [1.0] * 3
    with pytest.raises(UsageError, match=r"the environment gave the reward .* for decision 3 of the episode of seed"):
        game.step(0)


@pytest.mark.parametrize("fine", [0, -1, 2.5, True, np.int64(3), np.float32(0.5), LARGEST_REWARD, -LARGEST_REWARD])
def test_numbers_are_taken_as_they_are(fine):
    game = Game(Paying(fine), seed=0)
    game.reset()
    assert [game.step(0).reward for _ in range(4)][-1] == fine


@pytest.mark.parametrize("odd", [float("nan"), float("-inf"), 1e39])
@pytest.mark.parametrize("clip", [True, False])
def test_training_ends_in_one_line(call, tmp_path, tiny_toml, odd, clip):
    name = f"test/Paying{abs(hash(str(odd)))}-v0"
    if name not in gym.registry:
        gym.register(name, Paying, kwargs={"odd": odd})
    settings = tiny_toml("baseline", env=name, environment__frame_skip=1, decisions=40, dqn__clip_rewards=clip)
    result = call("train", "--config", settings, "--run", tmp_path / "run", "--json")
    assert result.status == 2 and result.out == ""
    assert f"the environment gave the reward {odd} for decision 3" in result.message
    assert RunFolder.open(tmp_path / "run").manifest()["status"] == "failed"
