"""Frame skip, actions, random starts and sticky actions; and what is no game for us."""

import gymnasium as gym
import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, action_meanings, make_env, rom_name
from semrl.envs.environment import newest_frames

PONG = "PongNoFrameskip-v4"
CATCH = "semrl/Catch-v0"


class Counter(gym.Env):
    """Shows how many frames were played and pays as many points as the action's number."""

    observation_space = gym.spaces.Box(0, 255, (4, 4, 3), np.uint8)
    action_space = gym.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed, options=options)
        self.frames, self.actions = 0, []
        return self._show(), {}

    def step(self, action):
        self.frames += 1
        self.actions.append(int(action))
        return self._show(), float(action), self.frames == 10, self.frames == 35, {}

    def get_action_meanings(self):
        return ["NOOP", "UP", "DOWN"]

    def _show(self):
        return np.full((4, 4, 3), self.frames, dtype=np.uint8)


class Machine(Counter):
    """The same with a continuous action."""

    action_space = gym.spaces.Box(-1, 1, (2,), np.float32)


@pytest.fixture(autouse=True)
def _registered():
    gym.register("Counter-v0", Counter)
    gym.register("Machine-v0", Machine)
    yield
    del gym.registry["Counter-v0"], gym.registry["Machine-v0"]


def frames_of(env, seed, actions):
    frames = [env.reset(seed=seed)[0]]
    frames += [env.step(action)[0] for action in actions]
    return np.stack(frames)


def test_the_emulator_skips_frames_itself():
    env = make_env(PONG, EnvironmentConfig(frame_skip=4))
    assert env.spec.kwargs["frameskip"] == 4
    start = frames_of(env, 0, [])
    assert env.unwrapped.ale.getEpisodeFrameNumber() == 0 and len(start) == 1
    env.step(0)
    assert env.unwrapped.ale.getEpisodeFrameNumber() == 4


def test_skipping_equals_repeating():
    every = make_env(PONG, EnvironmentConfig(frame_skip=1))
    fourth = make_env(PONG, EnvironmentConfig(frame_skip=4))
    actions = np.random.default_rng(0).integers(2, size=60)
    every.reset(seed=0)
    fourth.reset(seed=0)
    for action in actions:
        rewards = 0.0
        for _ in range(4):
            frame, reward, *_ = every.step(action)
            rewards += reward
        skipped, reward, *_ = fourth.step(action)
        np.testing.assert_array_equal(skipped, frame)
        assert reward == rewards


def test_the_wrapper_sums_rewards_and_stops_at_the_end():
    env = make_env("Counter-v0", EnvironmentConfig(frame_skip=4))
    env.reset(seed=0)
    told = [env.step(2) for _ in range(3)]
    assert [t[0].max() for t in told] == [4, 8, 10]  # the last frame of each decision
    assert [t[1] for t in told] == [8.0, 8.0, 4.0]
    assert [t[2] for t in told] == [False, False, True]
    assert env.unwrapped.actions == [2] * 10


def test_without_skip_every_frame_is_a_decision():
    env = make_env("Counter-v0", EnvironmentConfig(frame_skip=1))
    env.reset(seed=0)
    assert env.step(1)[0].max() == 1


def test_pong_has_two_actions_that_move_the_paddle_up_and_down():
    env = make_env(PONG)
    assert env.action_space == gym.spaces.Discrete(2)
    rows = []
    for action in (0, 1):
        env.reset(seed=0)
        for _ in range(20):
            frame, *_ = env.step(action)
        rows.append(np.nonzero((frame[34:194] == (92, 186, 92)).all(axis=2))[0].mean())
    assert rows[0] < 40 and rows[1] > 120  # §3.1: RIGHT is up, LEFT is down


def test_other_games_have_what_they_offer():
    env = make_env("ALE/Breakout-v5")
    assert action_meanings(env) == ["NOOP", "FIRE", "RIGHT", "LEFT"]
    assert env.action_space == gym.spaces.Discrete(4)
    assert make_env(CATCH).action_space == gym.spaces.Discrete(2)


def test_actions_are_chosen_by_name():
    env = make_env("Counter-v0", EnvironmentConfig(frame_skip=1, actions=("DOWN", "NOOP")))
    env.reset(seed=0)
    env.step(0)
    env.step(np.int64(1))
    assert env.unwrapped.actions == [2, 0]
    assert make_env(PONG, EnvironmentConfig(actions=("NOOP", "FIRE", "LEFT"))).action_space.n == 3


def test_rom_names():
    assert rom_name(make_env(PONG)) == "pong"
    assert rom_name(make_env("ALE/Breakout-v5")) == "breakout"
    assert rom_name(make_env(CATCH)) is None


def test_starts_are_random_and_follow_from_the_seed():
    env = make_env("Counter-v0", EnvironmentConfig(frame_skip=1, max_noops=6))
    starts = [int(frames_of(env, seed, []).max()) for seed in range(100)]
    assert set(starts) == set(range(7))
    assert starts == [int(frames_of(env, seed, []).max()) for seed in range(100)]
    assert set(env.unwrapped.actions) <= {0}


def test_waiting_through_a_whole_episode_begins_another():
    env = make_env("Counter-v0", EnvironmentConfig(frame_skip=1, max_noops=40))
    assert {int(frames_of(env, seed, []).max()) for seed in range(60)} == set(range(10))


def test_games_without_an_action_for_waiting_begin_at_once():
    plain, waiting = make_env(CATCH), make_env(CATCH, EnvironmentConfig(max_noops=30))
    for seed in range(3):
        np.testing.assert_array_equal(plain.reset(seed=seed)[0], waiting.reset(seed=seed)[0])


def test_noops_in_pong_make_starts_differ():
    env = make_env(PONG, EnvironmentConfig(max_noops=30))
    starts = [frames_of(env, seed, [0, 0]) for seed in (0, 1, 2, 0)]
    np.testing.assert_array_equal(starts[0], starts[3])
    assert not np.array_equal(starts[0], starts[1]) or not np.array_equal(starts[0], starts[2])


@pytest.mark.parametrize("env_id", [PONG, "Counter-v0"])
def test_sticky_actions_are_random_and_follow_from_the_seed(env_id):
    actions = np.random.default_rng(0).integers(2, size=9 if env_id == "Counter-v0" else 60)
    sticky = make_env(env_id, EnvironmentConfig(frame_skip=1, sticky_actions=0.5))
    plain = make_env(env_id, EnvironmentConfig(frame_skip=1))
    frames = frames_of(sticky, 0, actions)
    np.testing.assert_array_equal(frames, frames_of(sticky, 0, actions))
    if env_id == PONG:
        assert not np.array_equal(frames, frames_of(plain, 0, actions))
        assert not np.array_equal(frames, frames_of(sticky, 1, actions))
    else:
        assert sticky.unwrapped.actions != actions.tolist()


def test_an_unknown_environment_gets_a_suggestion():
    with pytest.raises(UsageError, match="unknown environment 'PongNoFrameskp-v4'; did you mean PongNoFrameskip-v4"):
        make_env("PongNoFrameskp-v4")
    with pytest.raises(UsageError, match="did you mean PongNoFrameskip-v4"):
        make_env("pong")
    with pytest.raises(UsageError, match="there is no module 'no/such'"):
        make_env("no/such:thing")


def test_it_can_be_filmed():
    env = make_env(render_mode="rgb_array")
    frame, _ = env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), frame)


def test_continuous_actions_are_refused():
    with pytest.raises(UsageError, match=r"Machine-v0 has actions Box.*discrete"):
        make_env("Machine-v0")


def test_unknown_actions_are_refused():
    with pytest.raises(UsageError, match="no action JUMP; it has NOOP, UP, DOWN"):
        make_env("Counter-v0", EnvironmentConfig(actions=("UP", "JUMP")))


@pytest.mark.parametrize(
    "settings",
    [{"frame_skip": 0}, {"sticky_actions": 1.5}, {"sticky_actions": -0.1}, {"max_noops": -1}, {"max_frames": -1}],
)
def test_impossible_settings_are_refused(settings):
    with pytest.raises(UsageError, match=next(iter(settings))):
        EnvironmentConfig(**settings)


@pytest.mark.parametrize(
    ("env", "config"), [(PONG, {}), (PONG, {"sticky_actions": 0.25}), (CATCH, {}), ("Counter-v0", {})]
)
def test_who_looks_at_every_frame_plays_the_same_game(env, config):
    config = EnvironmentConfig(max_noops=0, **config)
    plain, watched = make_env(env, config), make_env(env, config, every_frame=True)
    assert np.array_equal(plain.reset(seed=4)[0], watched.reset(seed=4)[0])
    for action in np.random.default_rng(4).integers(2, size=30).tolist():
        wanted, found = plain.step(action), watched.step(action)
        assert np.array_equal(wanted[0], found[0]) and wanted[1:4] == found[1:4]
        frames = newest_frames(watched)
        assert 1 <= len(frames) <= 4 and np.array_equal(frames[-1], found[0])
        if env == "Counter-v0":
            assert [int(frame.min()) for frame in frames] == list(
                range(int(found[0].min()) - len(frames) + 1, int(found[0].min()) + 1)
            )
        if found[2] or found[3]:
            break
    assert newest_frames(make_env(CATCH, EnvironmentConfig(frame_skip=1))) == []
