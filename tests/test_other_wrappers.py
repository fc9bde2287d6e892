"""The wrappers beside those of others: recording, vectors in both autoreset modes, other processes."""

import pickle
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from semrl import SemanticEnv, SemanticObservation, SemanticVectorObservation, make_env, preset

CATCH = "semrl/Catch-v0"
EXAMPLES = Path(__file__).parents[1] / "examples"


def steps_of(env, seed, n=60):
    """Return what an environment shows and gives for the same random actions."""
    rng, seen = np.random.default_rng(seed), []
    shown, _ = env.reset(seed=seed)
    for _ in range(n):
        seen.append(shown)
        shown, reward, terminated, truncated, _ = env.step(int(rng.integers(2)))
        seen.append([reward, terminated, truncated])
        if terminated or truncated:
            shown, _ = env.reset()
    return seen


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_episode_statistics_are_those_of_the_game(objects_run):
    env = gym.wrappers.RecordEpisodeStatistics(SemanticObservation(make_env(CATCH), objects_run))
    env.reset(seed=2)
    total, length, over = 0.0, 0, False
    while not over:
        _, reward, terminated, truncated, info = env.step(1)
        total, length, over = total + float(reward), length + 1, terminated or truncated
    assert (info["episode"]["r"], info["episode"]["l"]) == (total, length) and length > 10


def test_videos_can_be_recorded(objects_run, tmp_path):
    pytest.importorskip("moviepy", reason="needs moviepy, with which Gymnasium writes videos")
    env = SemanticObservation(make_env(CATCH, render_mode="rgb_array"), objects_run)
    with gym.wrappers.RecordVideo(env, str(tmp_path), episode_trigger=lambda _: True) as recorded:
        steps_of(recorded, 0, 50)
    assert [path for path in tmp_path.glob("*.mp4") if path.stat().st_size]


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_several_games_at_once_show_what_each_shows_alone(objects_run, mode):
    """In one mode the last observation comes in its place, in the other one in the infos."""
    together = SemanticVectorObservation(SyncVectorEnv([lambda: make_env(CATCH)] * 2, autoreset_mode=mode), objects_run)
    alone = [SemanticObservation(make_env(CATCH), objects_run) for _ in range(2)]
    shown, _ = together.reset(seed=4)
    expected = [env.reset(seed=4 + i)[0] for i, env in enumerate(alone)]
    rng, over, ended = np.random.default_rng(0), [False, False], 0
    for _ in range(150):
        np.testing.assert_array_equal(shown, expected)
        actions = rng.integers(2, size=2)
        shown, rewards, terminations, truncations, infos = together.step(actions)
        for i, env in enumerate(alone):
            if over[i] and mode == AutoresetMode.NEXT_STEP:
                expected[i], over[i] = env.reset()[0], False
                continue
            expected[i], reward, terminated, truncated, _ = env.step(int(actions[i]))
            over[i] = terminated or truncated
            assert (rewards[i], terminations[i], truncations[i]) == (reward, terminated, truncated)
            if over[i] and mode == AutoresetMode.SAME_STEP:
                np.testing.assert_array_equal(infos["final_obs"][i], expected[i])
                expected[i], ended = env.reset()[0], ended + 1
            ended += over[i] and mode == AutoresetMode.NEXT_STEP
    assert ended > 2


def test_a_wrapped_game_survives_pickle_and_cloudpickle(objects_run):
    """As `SubprocVecEnv` sends what makes it to other processes, and others the environment itself."""
    cloudpickle = pytest.importorskip("cloudpickle")
    env = SemanticObservation(make_env(CATCH), objects_run)
    expected = steps_of(env, 3)
    for sent in (pickle.loads(pickle.dumps(env)), pickle.loads(cloudpickle.dumps(env))):
        assert same(steps_of(sent, 3), expected)
    made = pickle.loads(cloudpickle.dumps(lambda: SemanticObservation(make_env(CATCH), objects_run)))()
    assert same(steps_of(made, 3), expected)


def test_a_learned_environment_survives_cloudpickle():
    cloudpickle = pytest.importorskip("cloudpickle")
    quick = {"stability": {"decisions": 60}, "perception": {"foreground": {"background_frames": 30},
             "slot_assigner": {"frames": 30}}}  # fmt: skip
    env = SemanticEnv(make_env(CATCH), preset("semrl", "objects-map", quick), learn=False)
    sent = pickle.loads(cloudpickle.dumps(env))
    ours, theirs = (steps_of(one, 3, 20) for one in (env, sent))
    for one, other in zip(ours, theirs, strict=True):
        assert all(np.array_equal(one[k], other[k]) for k in one) if isinstance(one, dict) else one == other


@pytest.mark.slow
def test_games_in_other_processes_show_the_same(objects_run):
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    make = [lambda: SemanticObservation(make_env(CATCH), objects_run)] * 2
    games = [vec_env.SubprocVecEnv(make, start_method="spawn"), vec_env.DummyVecEnv(make)]
    for game in games:
        game.seed(5)
    shown = [game.reset() for game in games]
    for step in range(60):
        np.testing.assert_array_equal(*shown)
        shown = [game.step(np.array([step % 2, 1]))[0] for game in games]
    for game in games:
        game.close()


def test_the_file_for_rl_zoo_wraps_a_game(objects_run, monkeypatch, tmp_path):
    """The wrappers of ``env_wrapper``, made as RL Zoo makes them: by dotted name, one after the other."""
    yaml, zoo = pytest.importorskip("yaml"), pytest.importorskip("stable_baselines3")
    (settings,) = yaml.safe_load((EXAMPLES / "rl_zoo" / "ppo.yml").read_text()).values()
    monkeypatch.chdir(tmp_path)
    env = make_env(CATCH)
    for wrapper in settings.pop("env_wrapper"):
        ((name, arguments),) = wrapper.items()
        module, _, attribute = name.rpartition(".")
        kind = getattr(__import__(module, fromlist=[attribute]), attribute)
        env = kind(env, **{key: objects_run if key == "encoder" else value for key, value in arguments.items()})
    assert isinstance(env, SemanticObservation)
    steps, policy = settings.pop("n_timesteps"), settings.pop("policy")
    assert steps > 0 and settings.pop("n_envs") > 0
    agent = zoo.PPO(policy, env, **{**settings, "n_steps": 16, "batch_size": 16})
    agent.learn(16)
