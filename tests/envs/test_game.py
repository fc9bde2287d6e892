"""A saved game goes on exactly where it was, or says that it cannot."""

import gymnasium as gym
import numpy as np
import pytest

from semrl.core.arrays import digest
from semrl.core.errors import SemrlError
from semrl.envs import EnvironmentConfig, Game, make_env

PONG, CATCH = "PongNoFrameskip-v4", "semrl/Catch-v0"


def new_game(env_id, seed=0, **settings):
    return Game(make_env(env_id, EnvironmentConfig(**settings)), seed)


def play(game, n, seed):
    """Play on at random over the ends of episodes; return all that is seen."""
    rng = np.random.default_rng(seed)
    seen = []
    for _ in range(n):
        outcome = game.step(int(rng.integers(game.n_actions)))
        seen.append((outcome.observation.frame, outcome.observation.ram, outcome.reward, outcome.terminated))
        if outcome.done:
            seen.append(game.reset().frame)
    return seen


@pytest.mark.parametrize(
    ("env_id", "settings"),
    [(PONG, {}), (PONG, {"sticky_actions": 0.25}), (CATCH, {}), (CATCH, {"sticky_actions": 0.25})],
)
def test_a_restored_game_goes_on_the_same(env_id, settings):
    game = new_game(env_id, **settings)
    game.reset()
    play(game, 100, seed=1)
    saved = {name: array.copy() for name, array in game.to_arrays().items()}
    expected = play(game, 60, seed=2)  # in Catch this goes beyond the end of an episode

    restored = new_game(env_id, seed=7, **settings)
    observation = restored.from_arrays(saved)
    np.testing.assert_array_equal(observation.frame, saved["frame"])
    assert digest(restored.to_arrays()) == digest(saved)
    for a, b in zip(expected, play(restored, 60, seed=2), strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def test_ram_is_restored_too():
    game = new_game(PONG)
    game.reset()
    play(game, 30, seed=1)
    ram = game.env.unwrapped.ale.getRAM()
    np.testing.assert_array_equal(new_game(PONG).from_arrays(game.to_arrays()).ram, ram)


def test_random_starts_are_restored_too():
    settings = {"max_noops": 30}
    game = new_game(PONG, **settings)
    game.reset()
    game.reset()
    play(game, 20, seed=1)
    assert new_game(PONG, **settings).from_arrays(game.to_arrays()) is not None


def test_before_the_first_episode_there_is_nothing_to_see():
    game, other = new_game(CATCH), new_game(CATCH, seed=9)
    assert other.from_arrays(game.to_arrays()) is None
    np.testing.assert_array_equal(game.reset().frame, other.reset().frame)


def test_episodes_differ_and_follow_from_the_seed():
    first, second, other = new_game(CATCH, seed=0), new_game(CATCH, seed=0), new_game(CATCH, seed=1)
    frames = [np.stack([game.reset().frame for _ in range(5)]) for game in (first, second, other)]
    np.testing.assert_array_equal(frames[0], frames[1])
    assert not np.array_equal(frames[0], frames[2])
    assert len(np.unique(frames[0], axis=0)) > 1


def test_only_atari_games_have_ram():
    assert new_game(CATCH).reset().ram is None
    assert new_game(PONG).reset().ram.shape == (128,)


class Chance(gym.Env):
    """Each frame is drawn without regard to the seed."""

    observation_space = gym.spaces.Box(0, 255, (4, 4, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def __init__(self):
        self.rng = np.random.default_rng(0)

    def reset(self, *, seed=None, options=None):
        return self._show(), {}

    def step(self, action):
        return self._show(), 0.0, False, False, {}

    def _show(self):
        return self.rng.integers(256, size=(4, 4, 3), dtype=np.uint8)


def test_an_environment_that_does_not_repeat_itself_is_refused():
    game = Game(Chance(), seed=0)
    game.reset()
    game.step(0)
    with pytest.raises(SemrlError, match="did not repeat itself"):
        game.from_arrays(game.to_arrays())


def test_frames_are_not_shared_with_the_environment():
    game = new_game(PONG)
    first = game.reset().frame
    kept = first.copy()
    play(game, 30, seed=0)
    np.testing.assert_array_equal(first, kept)
