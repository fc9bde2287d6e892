"""What blinks is told from what moves or ends, and the maximum goes over as many frames as show it, no more."""

import gymnasium as gym
import numpy as np
import pytest

from semrl.envs import EnvironmentConfig, make_env
from semrl.envs.environment import blinking, pooled_frames
from semrl.envs.flicker import STEADY_FRAMES, Ground, background_of, farthest, flicker, needed_frames, watch

SKIP = 4


def film(draw, decisions=40, shape=(40, 60)):
    """Draw frames; `draw(t)` gives the places ``(y, x)`` of things of 4 by 4 pixels at frame t."""
    frames = np.zeros((decisions * SKIP, *shape, 3), np.uint8)
    for t, frame in enumerate(frames):
        for y, x in draw(t):
            frame[y : y + 4, x : x + 4] = 200
    return frames.reshape(decisions, SKIP, *shape, 3)


def away(t):
    """Return a column that changes from decision to decision, so that nothing belongs to the background."""
    return 6 * (t // 8 % 8)


def every(n, phase=0):
    """Return a thing that is drawn in every n-th frame."""
    return lambda t: [(10, away(t))] if t % n == phase else []


@pytest.mark.parametrize(
    ("draw", "needed"),
    [
        (every(1), 1),
        (every(2, phase=1), 1),  # it is in the last frame of each skip
        (every(2, phase=0), 2),
        (every(4, phase=3), 1),
        (every(4, phase=2), 2),
        (every(4, phase=1), 3),
        (every(4, phase=0), 4),
        (lambda t: [(10, away(t)), (30, away(t))][t % 2 : t % 2 + 1], 2),  # two in turns
        (lambda t: [(t % 36, 20)], 1),  # moves, one pixel a frame
        (lambda t: [(3 * t % 36, 20)], 1),
        (lambda t: [(10, away(t))] if t < 82 else [], 1),  # ends within a skip, for good
        (lambda t: [], 1),
    ],
)
def test_the_maximum_goes_over_as_many_frames_as_needed(draw, needed):
    measured = flicker(film(draw))
    assert needed_frames(measured) == (needed, "brightest")
    assert measured[needed - 1].blinking <= 0.01


def test_shares_of_a_thing_that_is_drawn_in_the_first_frame_only():
    last, two, three, four = flicker(film(every(4)))
    assert last.unshown == two.unshown == three.unshown == 1 and four.unshown == 0
    assert four.trails == 0  # it did not move
    assert last.blinking > 0.8  # but for where it is when nothing of it comes back


def test_shares_of_a_thing_that_moves():
    measured = flicker(film(lambda t: [(10, t % 56)]))  # 4 rows of 7 columns are lit, 4 in the last frame
    assert [m.blinking for m in measured] == [0, 0, 0, 0]
    np.testing.assert_allclose([m.unshown for m in measured], [3 / 7, 2 / 7, 1 / 7, 0], atol=0.03)
    np.testing.assert_allclose([m.trails for m in measured], [0, 1 / 7, 2 / 7, 3 / 7], atol=0.03)


def test_dark_sprites_need_what_is_farthest_from_the_background():
    dark = 255 - film(every(4))
    measured = flicker(dark)
    assert measured[0].blinking > 0.5 and needed_frames(measured) == (SKIP, "farthest")
    background = background_of(dark)
    pooled = flicker(dark, [background] * len(dark))
    assert pooled[SKIP - 1].blinking == pooled[SKIP - 1].unshown == 0


@pytest.mark.parametrize("seed", range(3))
def test_farthest_is_the_latest_frame_with_the_greatest_difference(seed):
    rng = np.random.default_rng(seed)
    frames = list(rng.integers(0, 3, (3, 7, 8, 3), np.uint8) * 100)
    background = rng.integers(0, 3, (7, 8, 3), np.uint8) * 100
    shown = farthest(frames, background)
    for y, x in np.ndindex(7, 8):
        distances = [int(np.abs(one[y, x] - background[y, x].astype(int)).sum()) for one in frames]
        latest = max(i for i in range(3) if distances[i] == max(distances))
        np.testing.assert_array_equal(shown[y, x], frames[latest][y, x])


@pytest.mark.parametrize("stride", [1, 2, 3])
def test_the_ground_follows_what_stays_and_nothing_that_blinks(stride):
    known = np.full((-(-12 // stride), -(-20 // stride), 3), 50, np.uint8)
    first = np.full((12, 20, 3), 50, np.uint8)
    ground = Ground(known, first)
    for t in range(40):
        frame = first.copy()
        frame[:4] = 90  # a part changes for good
        if t % 4 < 3:
            frame[6:9, 5:9] = 200  # blinks in its place
        ground.see(frame)
        assert (ground.colours[:4] == (90 if t >= STEADY_FRAMES - 1 else 50)).all()
        assert (ground.colours[4:] == 50).all()


class Blinker(gym.Env):
    """A lamp that goes from place to place and is lit in every other frame."""

    observation_space = gym.spaces.Box(0, 255, (40, 60, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)
    period = 2

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self.frame(), {}

    def step(self, action):
        self.t += 1
        return self.frame(), 0.0, False, self.t >= 200, {}

    def frame(self):
        frame = np.zeros((40, 60, 3), np.uint8)
        if self.t % self.period == 1 % self.period:
            frame[10:14, away(self.t) : away(self.t) + 4] = 200
        return frame


class Steady(Blinker):
    period = 1


class Shadow(Blinker):
    """What blinks is darker than the ground."""

    def frame(self):
        return 255 - super().frame()


@pytest.mark.parametrize(
    ("world", "frames", "pooling"), [(Blinker, 2, "brightest"), (Shadow, 4, "farthest"), (Steady, 1, "brightest")]
)
def test_how_many_is_found_out_when_the_environment_is_made(world, frames, pooling):
    automatic, last = EnvironmentConfig(max_frames=0), EnvironmentConfig()
    gym.register("Lamp-v0", world)
    try:
        for source in ("Lamp-v0", world()):
            assert pooled_frames(make_env(source, automatic)) == (frames, pooling)
            assert blinking(make_env(source, automatic), SKIP) <= 0.02
            assert (blinking(make_env(source, last), SKIP) > 0.5) == (frames > 1)
        once = make_env("Lamp-v0", EnvironmentConfig(max_frames=0, frame_skip=1))
        assert pooled_frames(once) == (1, "brightest")
    finally:
        del gym.registry["Lamp-v0"]


@pytest.mark.parametrize(
    ("env_id", "frames"), [("PongNoFrameskip-v4", 1), ("AsteroidsNoFrameskip-v4", 2), ("semrl/Catch-v0", 1)]
)
def test_games(env_id, frames):
    env = make_env(env_id, EnvironmentConfig(max_frames=0))
    assert pooled_frames(env) == (frames, "brightest")
    env.close()


def test_a_shadow_is_seen_in_every_decision_and_repeats():
    config = EnvironmentConfig(max_frames=SKIP, pooling="farthest")
    first, second = make_env(Shadow(), config), make_env(Shadow(), config)
    for env in (first, second):
        env.reset(seed=0)
    for _ in range(30):
        one, other = first.step(0)[0], second.step(0)[0]
        np.testing.assert_array_equal(one, other)
        assert np.count_nonzero((one != 255).all(-1)) >= 16


def test_pong_stays_what_it_was():
    plain, automatic = make_env(), make_env(config=EnvironmentConfig(max_frames=0))
    for env in (plain, automatic):
        env.reset(seed=5)
    for action in np.random.default_rng(0).integers(2, size=60).tolist():
        one, other = plain.step(action), automatic.step(action)
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:]


def test_asteroids_are_seen():
    shown, every_frame = (make_env("AsteroidsNoFrameskip-v4", c) for c in (
        EnvironmentConfig(max_frames=0), EnvironmentConfig(frame_skip=1))
    )  # fmt: skip
    shown.reset(seed=0), every_frame.reset(seed=0)
    seen, passed = [], []
    for action in np.random.default_rng(0).integers(14, size=60).tolist():
        four = [every_frame.step(action)[0] for _ in range(SKIP)]
        seen.append((shown.step(action)[0][20:190] > 0).any(-1).sum())
        passed.append((np.max(four, axis=0)[20:190] > 0).any(-1).sum())
    assert np.mean(seen) > 0.8 * np.mean(passed)  # the rest is what moved on


def test_watching_holds_each_action_and_shows_every_frame():
    env = Blinker()
    frames = watch(env, SKIP, seed=0, decisions=5)
    assert frames.shape == (5, SKIP, 40, 60, 3)
    assert [frame.any() for frame in frames.reshape(-1, 40, 60, 3)] == [True, False] * 10
