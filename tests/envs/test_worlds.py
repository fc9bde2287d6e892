import warnings

import cv2
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from semrl.core.errors import DataError, UsageError
from semrl.envs.catch import FIRST_COLUMN_PX, LAST_BALL_COLUMN_PX, LAST_PADDLE_COLUMN_PX, Catch
from semrl.envs.maze import N_TILES, OUTSIDE, TRANSITIONS, FourRooms, shortest_steps
from semrl.envs.worlds import register_worlds

LEFT, RIGHT = 0, 1


def play(env, actions, seed):
    """Everything that an episode shows, as a list."""
    shown = [env.reset(seed=seed)[0]]
    for action in actions:
        observation, reward, terminated, _, info = env.step(action)
        shown += [observation, reward, terminated, info["coordinates"]]
    return shown


def landing_column(coordinates):
    """Where the ball will come down, by unfolding its bounces."""
    span = LAST_BALL_COLUMN_PX - FIRST_COLUMN_PX
    frames_left = 36 - round(float(coordinates[0]) * 36)
    unfolded = float(coordinates[1]) * span + frames_left * (float(coordinates[2]) * 4 - 2)
    unfolded %= 2 * span
    return FIRST_COLUMN_PX + min(unfolded, 2 * span - unfolded)


def perfect_action(coordinates):
    paddle = FIRST_COLUMN_PX + float(coordinates[3]) * (LAST_PADDLE_COLUMN_PX - FIRST_COLUMN_PX)
    return RIGHT if paddle + 8 < landing_column(coordinates) + 1.5 else LEFT


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("semrl/Catch-v0", {"observation": "frame"}),
        ("semrl/Catch-v0", {"observation": "vector"}),
        ("semrl/FourRooms-v0", {}),
    ],
)
def test_gymnasium_accepts_the_worlds(name, options):
    register_worlds()
    register_worlds()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(name, **options).unwrapped)


@pytest.mark.parametrize("observation", ["frame", "vector"])
def test_catch_is_determined_by_seed_and_actions(observation):
    actions = np.random.default_rng(0).integers(2, size=180)
    first, second, other = (play(Catch(observation=observation), actions, seed) for seed in (3, 3, 4))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))


@pytest.mark.parametrize("seed", range(10))
def test_perfect_play_catches_every_ball(seed):
    env = Catch(observation="vector")
    coordinates, _ = env.reset(seed=seed)
    total, frames, terminated = 0.0, 0, False
    while not terminated:
        coordinates, reward, terminated, _, _ = env.step(perfect_action(coordinates))
        assert coordinates.min() >= 0
        assert coordinates.max() <= 1
        total += reward
        frames += 1
    assert (total, frames) == (5, 180)


def test_staying_in_a_corner_misses_some_balls():
    env = Catch(balls=20)
    env.reset(seed=0)
    rewards = [env.step(LEFT)[1] for _ in range(20 * 36)]
    assert set(rewards) == {-1.0, 0.0, 1.0}
    assert sum(map(abs, rewards)) == 20


def test_every_ball_can_be_caught_with_two_actions_and_frame_skip():
    """Nine decisions of four frames reach a catching place from every place, for every landing column."""

    def moved(paddle, action):
        return min(max(paddle + (8 if action == RIGHT else -8), FIRST_COLUMN_PX), LAST_PADDLE_COLUMN_PX)

    for start in range(FIRST_COLUMN_PX, LAST_PADDLE_COLUMN_PX + 1, 2):
        places = {start}
        for _ in range(9):
            places = {moved(place, action) for place in places for action in (LEFT, RIGHT)}
        for ball in range(FIRST_COLUMN_PX, LAST_BALL_COLUMN_PX + 1):
            assert any(-16 < place - ball < 3 for place in places), (start, ball)


def test_objects_of_a_frame_are_separate_components():
    env = Catch()
    frame, _ = env.reset(seed=0)
    actions = np.random.default_rng(0).integers(2, size=180)
    threshold = None
    for action in actions:
        image = cv2.cvtColor(cv2.resize(frame, (84, 84), interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
        otsu, _ = cv2.threshold(image, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
        threshold = threshold or 0.9 * otsu
        mask = (image > threshold).astype(np.uint8)
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        sizes = sorted((int(s[cv2.CC_STAT_HEIGHT]), int(s[cv2.CC_STAT_WIDTH])) for s in stats[1:])
        assert sizes == [(3, 3), (3, 16), (84, 2), (84, 2)]
        frame = env.step(action)[0]


def test_rendering():
    env = Catch(observation="vector", render_mode="rgb_array")
    env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), env.frame())
    maze = FourRooms(render_mode="ansi")
    maze.reset(options={"tile": 13})
    assert maze.render().splitlines()[:2] == ["..........", "...@......"]


def test_shortest_steps_obey_bellman():
    steps = shortest_steps()
    after = np.where(TRANSITIONS == OUTSIDE, 0, steps[TRANSITIONS])
    np.testing.assert_array_equal(steps, 1 + after.min(axis=1))
    assert steps[2] == 1
    # From the far corner: 6 to the doorway, 5 into the next room's, 5 into the exit's, 1 out.
    assert steps[99] == steps.max() == 17


def test_rooms_are_joined_by_four_doorways():
    rooms = np.arange(N_TILES) // 50 * 2 + np.arange(N_TILES) % 10 // 5
    inside = TRANSITIONS != OUTSIDE
    crossing = inside & (rooms[:, None] != rooms[TRANSITIONS])
    assert crossing.sum() == 8  # each doorway in both directions
    assert (~inside).sum() == 1
    tiles, actions = np.nonzero(inside & (np.arange(N_TILES)[:, None] != TRANSITIONS))
    np.testing.assert_array_equal(TRANSITIONS[TRANSITIONS[tiles, actions], (actions + 2) % 4], tiles)


def test_maze_pays_one_a_step_and_ends_outside():
    env = FourRooms()
    tile, _ = env.reset(options={"tile": 12})
    assert tile == 12
    assert env.step(3)[:4] == (2, -1.0, False, False)
    assert env.step(3)[:4] == (2, -1.0, True, False)
    starts = [int(env.reset(seed=seed)[0]) for seed in (1, 1, 2)]
    assert starts[0] == starts[1] != starts[2]


def test_wrong_calls_are_named():
    with pytest.raises(UsageError, match="sound"):
        Catch(observation="sound")
    with pytest.raises(UsageError, match="render mode"):
        FourRooms(render_mode="human")
    with pytest.raises(DataError, match="tiles"):
        FourRooms().reset(options={"tile": 100})
    for env in (Catch(), FourRooms()):
        with pytest.raises(DataError, match="actions"):
            env.step(7)
