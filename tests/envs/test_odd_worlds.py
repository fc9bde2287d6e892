"""Worlds with one odd thing each are trained in, tested, resumed, explained; or refused in one line, with status 2."""

import enum
import re
from typing import ClassVar

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

RGB = spaces.Box(0, 255, (42, 48, 3), np.uint8)


class Lawn(gym.Env):
    """A ball that falls on a bat; it pays when they meet."""

    observation_space = RGB
    action_space = spaces.Discrete(3)
    length = 60

    def __init__(self, render_mode=None):
        self.render_mode = render_mode

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t, self.bat, self.ball = 0, 20, self.drop()
        return self.frame(), {}

    def drop(self):
        return [2, int(self.np_random.integers(2, 42))]

    def step(self, action):
        self.t += 1
        self.bat = min(max(self.bat + 2 * self.direction(action), 2), 36)
        self.ball[0] += 2
        reward = 0.0
        if self.ball[0] >= 36:
            reward = 1.0 if abs(self.ball[1] - self.bat - 4) < 7 else -1.0
            self.ball = self.drop()
        return self.frame(), reward, self.t >= self.length, False, {}

    def direction(self, action):
        assert self.action_space.contains(action)
        return int(action) - 1

    def frame(self):
        frame = np.zeros((42, 48, 3), np.uint8)
        frame[self.ball[0] : self.ball[0] + 3, self.ball[1] : self.ball[1] + 3] = 255
        frame[38:40, self.bat : self.bat + 8] = (200, 72, 72)
        return frame


class Odd:
    """Lawns with one odd thing each."""

    class Plain(Lawn):
        pass

    class FromMinusOne(Lawn):
        action_space = spaces.Discrete(3, start=-1)

        def direction(self, action):
            assert self.action_space.contains(action)
            return int(action)

    class OneAction(Lawn):
        action_space = spaces.Discrete(1)

    class Choices(Lawn):
        action_space = spaces.MultiDiscrete([3, 2])

        def direction(self, action):
            assert self.action_space.contains(action)
            return int(action[0]) - 1

    class Buttons(Lawn):
        action_space = spaces.MultiBinary(2)

        def direction(self, action):
            assert self.action_space.contains(action)
            return int(action[1]) - int(action[0])

    class Grey(Lawn):
        observation_space = spaces.Box(0, 255, (42, 48), np.uint8)

        def frame(self):
            return super().frame().max(axis=2)

    class Dictionary(Lawn):
        observation_space = spaces.Dict(image=RGB, time=spaces.Discrete(100))

        def frame(self):
            return {"image": super().frame(), "time": self.t}

    class Rendered(Lawn):
        metadata: ClassVar[dict[str, list[str]]] = {"render_modes": ["rgb_array"]}
        observation_space = spaces.Box(0, 1, (2,), np.float32)

        def frame(self):
            return np.zeros(2, np.float32)

        def render(self):
            return Lawn.frame(self)

    class OneBuffer(Lawn):
        buffer = np.zeros((42, 48, 3), np.uint8)

        def frame(self):
            self.buffer[:] = super().frame()
            return self.buffer

    class ReadOnly(Lawn):
        def frame(self):
            frame = super().frame()
            frame.setflags(write=False)
            return frame

    class OddNames(Lawn):
        def get_action_meanings(self):
            return ["left <&\"'> ü 日", "", "right/../%41 \n#x"]

    class NumberNames(Lawn):
        def get_action_meanings(self):
            return [2, 3, 5]

    class MappedNames(Lawn):
        def get_action_meanings(self):
            return {0: "L", 1: "N", 2: "R"}

    class EnumNames(Lawn):
        def get_action_meanings(self):
            return list(enum.Enum("Way", "LEFT STAY RIGHT"))

    class ArrayReward(Lawn):
        def step(self, action):
            frame, reward, *rest = super().step(action)
            return frame, np.array([reward]), *rest


class Refused:
    """Lawns that cannot be learned in, and what is said of them."""

    class Continuous(Lawn):
        told = "only discrete ones can be learned"
        action_space = spaces.Box(-1, 1, (2,), np.float32)

    class TooMany(Lawn):
        told = "combinations of actions, more than 1,024"
        action_space = spaces.MultiBinary(20)

    class Blind(Lawn):
        told = "not RGB frames, and renders none"
        observation_space = spaces.Box(0, 1, (2,), np.float32)

    class TwoEyes(Lawn):
        told = "shows several images"
        observation_space = spaces.Dict(left=RGB, right=RGB)

    class Liar(Lawn):
        told = "announces frames of uint8"

        def frame(self):
            return super().frame().astype(np.float32)

    class Lists(Lawn):
        told = "shows a list"

        def frame(self):
            return super().frame().tolist()

    class Growing(Lawn):
        told = r"shows uint8 \(44, 48, 3\)"
        n = 0

        def reset(self, **how):
            self.n += 1
            return super().reset(**how)

        def frame(self):
            return np.pad(super().frame(), ((0, 2 * (self.n > 1)), (0, 0), (0, 0)))

    class Shrinking(Lawn):
        told = r"shows uint8 \(40, 48, 3\)"

        def frame(self):
            return super().frame()[: 42 - 2 * (self.t > 10)]

    class OldReset(Lawn):
        told = "reset must return an observation and a dictionary"

        def reset(self, **how):
            return super().reset(**how)[0]

    class OldStep(Lawn):
        told = "step must return observation, reward"

        def step(self, action):
            frame, reward, ended, _, info = super().step(action)
            return frame, reward, ended, info

    class NoReward(Lawn):
        told = "pays None, which is no number"

        def step(self, action):
            frame, _, *rest = super().step(action)
            return frame, None, *rest

    class Failing(Lawn):
        told = "failed in step: ValueError: the connection is lost"

        def step(self, action):
            if self.t == 50:
                raise ValueError("the connection\nis lost")
            return super().step(action)


def names_of(worlds):
    return [name for name in vars(worlds) if not name.startswith("_")]


@pytest.fixture
def register():
    """Make a world known by an id, until the end of the test."""
    known = []

    def as_id(world):
        env_id = f"odd/{world.__name__}-v0"
        gym.register(env_id, world)
        known.append(env_id)
        return env_id

    yield as_id
    for env_id in known:
        gym.registry.pop(env_id, None)


@pytest.mark.parametrize("name", names_of(Odd))
def test_odd_worlds_are_learned_in(name, register, tiny_toml, call, tmp_path):
    env_id, run = register(getattr(Odd, name)), tmp_path / "run"  # at skip 4 its things go farther than a track's gate
    told = call(
        "train",
        "--run",
        run,
        "--config",
        tiny_toml("objects-map", env=env_id, decisions=300, environment__frame_skip=1),
        "--json",
    )
    assert told.status == 0, told.err
    assert "note:" not in told.err
    for argv in (
        ["train", "--run", run, "--resume"],
        ["eval", run, "--episodes", 1],
        ["map", run],
        ["explain", run, "--episode", 0, "--step", 2],
    ):
        told = call(*argv)
        assert told.status == 0 or (told.status == 2 and told.message), told.err
    assert "Traceback" not in told.err


@pytest.mark.parametrize("name", names_of(Refused))
def test_what_cannot_be_learned_in_is_refused_in_one_line(name, register, tiny_toml, call, tmp_path):
    world = getattr(Refused, name)
    told = call(
        "train", "--run", tmp_path / "run", "--config", tiny_toml("objects", env=register(world), decisions=300)
    )
    assert told.status == 2
    assert re.search(world.told, told.message), told.message
