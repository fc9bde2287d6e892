"""Ids as Gymnasium takes them, environments that were made, what an id means by itself; and all of it as bytes."""

import pickle
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import StickyAction

from semrl.core.errors import MissingExtraError, NoEnvironmentError, UsageError
from semrl.envs import EnvironmentConfig, action_meanings, make_env
from semrl.envs.environment import sticky_actions

PONG = "PongNoFrameskip-v4"
CATCH = "semrl/Catch-v0"

MODULE = """
import gymnasium as gym
import numpy as np

class Blank(gym.Env):
    observation_space = gym.spaces.Box(0, 255, (4, 4, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)
    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros((4, 4, 3), np.uint8), {}
    def step(self, action):
        return np.zeros((4, 4, 3), np.uint8), 0.0, False, False, {}

class Broken(Blank):
    def __init__(self):
        raise ValueError("no licence\\nmore of it")

gym.register("mine/Blank-v0", Blank)
gym.register("mine/Broken-v0", Broken)
"""


@pytest.fixture
def worlds(tmp_path, monkeypatch):
    """Write a module of environments that nobody has imported yet."""
    (tmp_path / "my_worlds.py").write_text(MODULE)
    (tmp_path / "faulty_worlds.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for env_id in ("mine/Blank-v0", "mine/Broken-v0"):
        gym.registry.pop(env_id, None)
    sys.modules.pop("my_worlds", None)


def frames_of(env, actions, seed=0):
    frames = [env.reset(seed=seed)[0], *(env.step(int(action))[0] for action in actions)]
    env.close()
    return np.stack(frames)


def test_a_module_is_imported_for_its_environments(worlds):
    with pytest.raises(UsageError, match="unknown environment 'mine/Blank-v0'"):
        make_env("mine/Blank-v0")
    assert make_env("my_worlds:mine/Blank-v0").spec.id == "mine/Blank-v0"
    assert make_env("mine/Blank-v0").reset(seed=0)[0].shape == (4, 4, 3)  # now it is known


@pytest.mark.parametrize(
    ("env_id", "told"),
    [
        ("no_such_worlds:mine/Blank-v0", "there is no module 'no_such_worlds'"),
        ("faulty_worlds:mine/Blank-v0", "cannot import 'faulty_worlds' .*: ZeroDivisionError: division by zero"),
        ("my_worlds:mine/Blink-v0", "unknown environment 'my_worlds:mine/Blink-v0'; did you mean mine/Blank-v0"),
        ("my_worlds:mine/Broken-v0", "cannot make environment 'mine/Broken-v0': ValueError: no licence$"),
        (":", "unknown environment ':'"),
        ("", "unknown environment ''"),
        ("a b:c", "there is no module 'a b'"),
        ("..:c", "cannot import '..'"),
    ],
)
def test_what_cannot_be_made_is_told_in_one_line(worlds, env_id, told):
    with pytest.raises(NoEnvironmentError, match=told) as raised:
        make_env(env_id)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("env_id", "extra", "module"),
    [
        ("MiniGrid-Empty-5x5-v0", "minigrid", "minigrid"),
        ("BabyAI-GoToRedBall-v0", "minigrid", "minigrid"),
        ("VizdoomBasic-v1", "vizdoom", "vizdoom.gymnasium_wrapper"),
    ],
)
def test_a_missing_extra_is_named(monkeypatch, env_id, extra, module):
    monkeypatch.delitem(gym.registry, env_id, raising=False)
    monkeypatch.setitem(sys.modules, module, None)  # importing it fails
    with pytest.raises(MissingExtraError, match=f"the extra '{extra}' is needed for environment '{env_id}'"):
        make_env(env_id)


def test_an_environment_that_was_made_is_played_like_its_id():
    actions = np.random.default_rng(0).integers(2, size=20)
    by_id, made = make_env(CATCH), make_env(gym.make(CATCH))
    np.testing.assert_array_equal(frames_of(by_id, actions), frames_of(made, actions))
    emulator = make_env(gym.make(PONG))
    np.testing.assert_array_equal(frames_of(make_env(PONG), actions), frames_of(emulator, actions))


@pytest.mark.parametrize(
    ("env_id", "asked", "played"),
    [
        (PONG, None, 0.0),
        ("ALE/Pong-v5", None, 0.25),
        ("Pong-v0", None, 0.25),
        ("ALE/Pong-v5", 0.0, 0.0),
        ("ALE/Pong-v5", 0.1, 0.1),
        (PONG, 0.25, 0.25),
        (CATCH, None, 0.0),
        (CATCH, 0.3, 0.3),
    ],
)
def test_an_id_means_its_own_sticky_actions_unless_others_are_asked_for(env_id, asked, played):
    env = make_env(env_id, EnvironmentConfig(sticky_actions=asked))
    assert sticky_actions(env) == played
    env.close()


def test_sticky_actions_of_the_id_are_played():
    actions = np.random.default_rng(1).integers(2, size=80)
    seen = {
        (env_id, asked): frames_of(make_env(env_id, EnvironmentConfig(sticky_actions=asked)), actions)
        for env_id, asked in [("ALE/Pong-v5", None), ("ALE/Pong-v5", 0.25), ("ALE/Pong-v5", 0.0), (PONG, None)]
    }
    np.testing.assert_array_equal(seen["ALE/Pong-v5", None], seen["ALE/Pong-v5", 0.25])
    np.testing.assert_array_equal(seen["ALE/Pong-v5", 0.0], seen[PONG, None])
    assert not np.array_equal(seen["ALE/Pong-v5", None], seen[PONG, None])


def test_sticky_actions_of_an_environment_that_was_made():
    sticky = StickyAction(gym.make(CATCH), 0.5)
    assert sticky_actions(make_env(sticky)) == 0.5
    with pytest.raises(UsageError, match=r"semrl/Catch-v0 has sticky actions of its own, 0\.5, which cannot be made 0"):
        make_env(sticky, EnvironmentConfig(sticky_actions=0.0))


@pytest.mark.parametrize("max_frames", [2, 3, 4, 9])
@pytest.mark.parametrize("env_id", [PONG, CATCH, "AsteroidsNoFrameskip-v4"])
def test_the_brightest_of_the_last_frames_is_shown(env_id, max_frames):
    shown = make_env(env_id, EnvironmentConfig(max_frames=max_frames))
    every = make_env(env_id, EnvironmentConfig(frame_skip=1))
    np.testing.assert_array_equal(shown.reset(seed=3)[0], every.reset(seed=3)[0])
    for action in np.random.default_rng(2).integers(2, size=12).tolist():
        four = [every.step(action) for _ in range(4)]
        frame, reward, *_ = shown.step(action)
        np.testing.assert_array_equal(frame, np.max([step[0] for step in four][-max_frames:], axis=0))
        assert reward == sum(step[1] for step in four)
    shown.close(), every.close()


CONFIGS = [
    EnvironmentConfig(),
    EnvironmentConfig(max_noops=5, sticky_actions=0.2, max_frames=2),
    EnvironmentConfig(frame_skip=1),
]


@pytest.mark.parametrize("config", CONFIGS, ids=["default", "all", "every frame"])
@pytest.mark.parametrize("env_id", [PONG, "ALE/Pong-v5", CATCH])
def test_environments_can_be_sent_as_bytes(env_id, config):
    env = make_env(env_id, config)
    actions = np.random.default_rng(0).integers(env.action_space.n, size=10)
    copies = [
        pickle.loads(pickle.dumps(env)),
        gym.make(EnvSpec.from_json(env.spec.to_json()), disable_env_checker=True),
    ]
    frames = frames_of(env, actions)
    for copy in copies:
        assert action_meanings(copy) == action_meanings(env)
        np.testing.assert_array_equal(frames_of(copy, actions), frames)


def test_cloudpickle_works_as_well():
    cloudpickle = pytest.importorskip("cloudpickle")
    env = make_env(CATCH)
    copy = pickle.loads(cloudpickle.dumps(env))
    np.testing.assert_array_equal(frames_of(copy, [0, 1, 1]), frames_of(env, [0, 1, 1]))
