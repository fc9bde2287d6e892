"""What is seen: images of every kind become RGB frames, what is only rendered is seen rendered, the rest is refused."""

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, make_env
from semrl.envs.pictures import image_entry

EVERY_FRAME = EnvironmentConfig(frame_skip=1)
RGB = spaces.Box(0, 255, (6, 8, 3), np.uint8)
GREY = spaces.Box(0, 255, (6, 8), np.uint8)
FLAT = spaces.Box(-1, 1, (4,), np.float32)


class Shown(gym.Env):
    """Shows whatever it is given."""

    action_space = spaces.Discrete(2)

    def __init__(self, space, frames, render_mode=None, modes=()):
        self.observation_space, self.frames, self.render_mode = space, frames, render_mode
        self.metadata = {"render_modes": list(modes), "render_fps": 30}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self.frames[0], {}

    def step(self, action):
        self.t += 1
        return self.frames[self.t], 0.0, False, False, {}

    def render(self):
        return np.full((5, 7, 3), self.t, np.uint8)


def random_frames(shape, n=3):
    return list(np.random.default_rng(0).integers(256, size=(n, *shape), dtype=np.uint8))


@pytest.mark.parametrize("shape", [(6, 8), (6, 8, 1)])
def test_grey_images_have_three_equal_channels(shape):
    frames = random_frames(shape)
    env = make_env(Shown(spaces.Box(0, 255, shape, np.uint8), frames), EVERY_FRAME)
    assert env.observation_space == RGB
    seen = [env.reset(seed=0)[0], env.step(0)[0], env.step(1)[0]]
    for frame, grey in zip(seen, frames, strict=True):
        assert frame.shape == (6, 8, 3) and frame.dtype == np.uint8
        for channel in range(3):
            np.testing.assert_array_equal(frame[..., channel], grey.reshape(6, 8))


@pytest.mark.parametrize(
    ("entries", "key"),
    [
        ({"picture": RGB, "speed": FLAT}, "picture"),
        ({"speed": FLAT, "eye": GREY}, "eye"),
        ({"labels": GREY, "screen": RGB}, "screen"),
        ({"pixels": RGB, "image": RGB}, "image"),
        ({"speed": FLAT}, None),
    ],
)
def test_the_image_of_a_dictionary_is_found(entries, key):
    assert image_entry(spaces.Dict(entries), "it") == key


def test_a_dictionary_shows_its_image():
    frames = random_frames((6, 8, 3))
    told = [{"speed": np.zeros(4, np.float32), "eye": frame} for frame in frames]
    env = make_env(Shown(spaces.Dict(speed=FLAT, eye=RGB), told), EVERY_FRAME)
    np.testing.assert_array_equal(env.reset(seed=0)[0], frames[0])
    np.testing.assert_array_equal(env.step(0)[0], frames[1])


def test_of_two_images_one_must_be_named():
    with pytest.raises(UsageError, match=r"Shown shows several images \(left, right\)"):
        make_env(Shown(spaces.Dict(left=RGB, right=RGB), []))


def test_what_is_no_image_is_seen_rendered():
    env = make_env(
        Shown(FLAT, [np.zeros(4, np.float32)] * 9, "rgb_array", ["rgb_array"]), EnvironmentConfig(frame_skip=2)
    )
    assert env.observation_space.shape == (5, 7, 3)
    assert [env.reset(seed=0)[0].max(), env.step(0)[0].max(), env.step(1)[0].max()] == [0, 2, 4]


def test_by_id_the_render_mode_is_found():
    def entry(render_mode=None):
        return Shown(FLAT, [np.zeros(4, np.float32)] * 9, render_mode, ["ansi", "rgb_array"])

    gym.register("Rendered-v0", entry)
    try:
        env = make_env("Rendered-v0", EVERY_FRAME)
        assert env.observation_space.shape == (5, 7, 3)
        assert [env.reset(seed=0)[0].max(), env.step(0)[0].max()] == [0, 1]
    finally:
        del gym.registry["Rendered-v0"]


def drawn(render_mode=None):
    """Make an environment that, like those that draw with pygame, holds what cannot be sent."""
    env = Shown(FLAT, [np.zeros(4, np.float32)] * 9, render_mode, ["rgb_array"])
    env.canvas = (line for line in ())
    return env


def test_rendered_environments_can_be_sent_as_bytes():
    gym.register("Drawn-v0", f"{__name__}:drawn")
    try:
        env = make_env("Drawn-v0", EVERY_FRAME)
        for copy in (pickle.loads(pickle.dumps(env)), gym.make(EnvSpec.from_json(env.spec.to_json()))):
            assert copy.action_space == env.action_space
            assert [copy.reset(seed=0)[0].max(), copy.step(0)[0].max()] == [0, 1]
    finally:
        del gym.registry["Drawn-v0"]


def test_what_renders_only_text_is_refused():
    with pytest.raises(UsageError, match=r"semrl/FourRooms-v0 shows Discrete\(100\), not RGB frames, and renders none"):
        make_env("semrl/FourRooms-v0")


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Acrobot-v1"])
def test_classic_control_is_seen_or_says_what_is_missing(env_id):
    try:
        import pygame  # noqa: F401
    except ImportError:
        with pytest.raises(UsageError, match=f"{env_id} cannot be rendered: pygame is not installed"):
            make_env(env_id)
    else:
        env = make_env(env_id, EVERY_FRAME)
        first = env.reset(seed=0)[0]
        assert first.shape == env.observation_space.shape and first.min() < first.max()


@pytest.mark.parametrize("space", [FLAT, spaces.Discrete(5), spaces.Box(0, 1, (6, 8, 3), np.float32)])
def test_what_cannot_be_seen_is_refused(space):
    with pytest.raises(UsageError, match=r"Shown shows .*, not RGB frames, and renders none"):
        make_env(Shown(space, []))


def frames_with(first, later):
    return Shown(RGB, [first, later, later])


@pytest.mark.parametrize(
    ("later", "told"),
    [
        (np.zeros((6, 8, 3), np.float32), "shows float32"),
        (np.zeros((5, 8, 3), np.uint8), r"shows uint8 \(5, 8, 3\)"),
        ([[0]], "shows a list"),
        (None, "shows a NoneType"),
    ],
)
def test_an_environment_is_held_to_its_word(later, told):
    good = np.zeros((6, 8, 3), np.uint8)
    env = make_env(frames_with(good, later), EVERY_FRAME)
    env.reset(seed=0)
    with pytest.raises(UsageError, match=rf"announces frames of uint8 \(6, 8, 3\) and {told}"):
        env.step(0)
    with pytest.raises(UsageError, match=told):
        make_env(frames_with(later, good), EVERY_FRAME).reset(seed=0)


def test_frames_stay_what_they_were():
    buffer = np.zeros((6, 8, 3), np.uint8)

    class Drawing(Shown):
        def step(self, action):
            buffer[:] += 1
            return super().step(action)

    env = make_env(Drawing(RGB, [buffer] * 3), EVERY_FRAME)
    seen = [env.reset(seed=0)[0], env.step(0)[0], env.step(0)[0]]
    assert [frame.max() for frame in seen] == [0, 1, 2]


class Paying(Shown):
    """Returns a step or a reset of its own."""

    def __init__(self, step=None, reset=None):
        super().__init__(RGB, random_frames((6, 8, 3)))
        self.returns = step, reset

    def reset(self, **how):
        told = super().reset(**how)
        return self.returns[1](told) if self.returns[1] else told

    def step(self, action):
        told = super().step(action)
        return self.returns[0](*told) if self.returns[0] else told


@pytest.mark.parametrize("reward", [1, True, np.float32(1), np.array([1.0], np.float32), np.int64(1)])
def test_rewards_are_numbers_of_any_kind(reward):
    env = make_env(Paying(step=lambda o, r, t, u, i: (o, reward, np.bool_(False), np.bool_(True), i)), EVERY_FRAME)
    env.reset(seed=0)
    _, paid, terminated, truncated, _ = env.step(0)
    assert (paid, terminated, truncated) == (1.0, False, True)
    assert type(paid) is float and type(terminated) is bool and type(truncated) is bool


@pytest.mark.parametrize("reward", [None, "one", [1, 2], np.zeros(2)])
def test_what_is_no_reward_is_refused(reward):
    env = make_env(Paying(step=lambda o, r, t, u, i: (o, reward, t, u, i)))
    env.reset(seed=0)
    with pytest.raises(UsageError, match="which is no number"):
        env.step(0)


def test_the_old_interface_is_refused():
    env = make_env(Paying(step=lambda o, r, t, u, i: (o, r, t, i)))
    env.reset(seed=0)
    with pytest.raises(UsageError, match=r"Paying\.step must return observation, reward, terminated, truncated"):
        env.step(0)
    with pytest.raises(UsageError, match=r"Paying\.reset must return an observation and a dictionary"):
        make_env(Paying(reset=lambda told: told[0])).reset(seed=0)


def test_an_exception_of_the_environment_is_told_in_one_line():
    def fails(*_):
        raise ValueError("the connection is lost")

    env = make_env(Paying(step=fails))
    env.reset(seed=0)
    with pytest.raises(UsageError, match="Paying failed in step: ValueError: the connection is lost"):
        env.step(0)
    with pytest.raises(UsageError, match="Paying failed in reset: ValueError"):
        make_env(Paying(reset=fails)).reset(seed=0)
