import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from semrl import SemanticObservation, SemanticVectorObservation, make_env
from semrl.core.errors import UsageError
from semrl.evaluation import load_encoder, load_player
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders import ENCODERS
from semrl.training import train

CATCH = "semrl/Catch-v0"


def raw():
    return gym.make(CATCH, disable_env_checker=True)


@pytest.mark.parametrize("output", ["vector", "labels"])
@pytest.mark.parametrize(
    "make",
    [raw, lambda: make_env(CATCH)],
    ids=["raw", "make_env"],
)
def test_gymnasium_finds_nothing_wrong(semantic_run, output, make):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(infinity|is different from the unwrapped version).*")
        warnings.filterwarnings("ignore", message=".*render.*")
        check_env(SemanticObservation(make(), semantic_run, output))


@pytest.mark.parametrize("output", ["vector", "labels"])
def test_stable_baselines3_finds_nothing_wrong(semantic_run, output):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(SemanticObservation(make_env(CATCH), semantic_run, output))


def test_the_vector_is_what_the_agents_network_computes_with(semantic_run):
    """Current embedding and difference, at every decision of an episode that the agent itself plays."""
    player = load_player(semantic_run)
    env = SemanticObservation(make_env(CATCH), player.encoder)
    seen, actions = [], []
    act = player.agent.best_action

    def spy(shown):
        seen.append(np.concatenate([shown.vectors[0], shown.vectors[0] - shown.vectors[1]]))
        actions.append(act(shown))
        return actions[-1]

    player.agent.best_action = spy
    game = player.new_game(4)
    for _ in player.play(game, np.random.default_rng(0)):
        pass
    observation, _ = env.reset(seed=int(game.to_arrays()["episode_seed"]))
    for expected, action in zip(seen, actions, strict=True):
        np.testing.assert_array_equal(observation, expected)
        assert observation.dtype == np.float32 and env.observation_space.contains(observation)
        observation, *_ = env.step(action)
    assert len(actions) == 45 and any(np.any(vector[16:]) for vector in seen)


def test_labels_are_what_the_model_birch_sees(semantic_run):
    env = SemanticObservation(make_env(CATCH), load_encoder(semantic_run), "labels")
    labels, _ = env.reset(seed=1)
    frame, _ = make_env(CATCH).reset(seed=1)
    grey = frame[::2, ::2].max(axis=2)  # Catch draws every pixel of the small image twice as large
    assert labels.shape == (84, 84, 1)
    np.testing.assert_array_equal(labels[:, :, 0] > 0, grey > 0)


def test_a_new_episode_begins_without_a_difference(semantic_run):
    env = SemanticObservation(make_env(CATCH), semantic_run)
    env.reset(seed=0)
    for _ in range(5):
        env.step(1)
    observation, _ = env.reset(seed=0)
    assert not observation[16:].any() and observation[:16].any()


def test_frames_that_are_no_images_are_refused(semantic_run):
    for env in (gym.make("semrl/FourRooms-v0"), gym.make("semrl/Catch-v0", observation="vector")):
        with pytest.raises(UsageError, match="needs RGB frames"):
            SemanticObservation(env, semantic_run)


def test_runs_that_did_not_learn_it_are_refused(semantic_run, baseline_run, tmp_path, tiny):
    env = make_env(CATCH)
    with pytest.raises(UsageError, match="output must be 'vector' or 'labels', not 'vectors'"):
        SemanticObservation(env, semantic_run, "vectors")
    for output in ("vector", "labels"):
        need = "a vector" if output == "vector" else "objects"
        with pytest.raises(UsageError, match=f"output '{output}' needs a run whose agent sees {need}; this one's"):
            SemanticObservation(env, baseline_run, output)
        with pytest.raises(UsageError, match="there is no run"):
            SemanticObservation(env, tmp_path / "none", output)
    with pytest.raises(UsageError, match="output 'vector' needs a run whose agent sees a vector; this one's does not"):
        SemanticObservation(env, ENCODERS.load("classes")(PerceptionConfig(embedder="hashed")), "vector")
    for decisions in (2, 6, 10):  # stopped while looking for the threshold, in PCA, in Birch
        train(tmp_path / f"short-{decisions}", tiny(decisions=decisions))
        with pytest.raises(UsageError, match="needs more decisions") if decisions < 10 else pytest.raises(UsageError):
            SemanticObservation(env, tmp_path / f"short-{decisions}")


def test_an_embedding_that_was_not_trained_is_refused(semantic_run):
    pytest.importorskip("gensim")
    learned = load_encoder(semantic_run)
    encoder = ENCODERS.load("scene")(PerceptionConfig(embedder="doc2vec"))
    for name in ("detector", "reducer", "clusterer"):
        setattr(encoder.perception, name, getattr(learned.perception, name))
    with pytest.raises(UsageError, match="has not learned"):
        SemanticObservation(make_env(CATCH), encoder)
    labels, _ = SemanticObservation(make_env(CATCH), encoder, "labels").reset(seed=0)
    assert labels.any()


@pytest.mark.parametrize("run", ["semantic_run", "objects_run", "tracked_run"])
def test_several_environments_are_seen_as_each_of_them_alone(request, run):
    """Where objects are tracked, each environment has tracks of its own."""
    encoder = load_encoder(request.getfixturevalue(run))
    several = SemanticVectorObservation(gym.vector.SyncVectorEnv([raw] * 3), encoder)
    alone = [SemanticObservation(raw(), encoder) for _ in range(3)]
    seen, _ = several.reset(seed=5)
    expected = [env.reset(seed=5 + i)[0] for i, env in enumerate(alone)]
    over, rng = np.zeros(3, bool), np.random.default_rng(0)
    for _ in range(40):  # several episodes: after its end an environment is reset by the next step
        np.testing.assert_array_equal(seen, expected)
        assert several.observation_space.contains(seen)
        actions = rng.integers(2, size=3)
        seen, _, terminated, truncated, _ = several.step(actions)
        pairs = zip(alone, actions, over, strict=True)
        expected = [env.reset()[0] if done else env.step(action)[0] for env, action, done in pairs]
        over = terminated | truncated


def test_several_environments_need_frames_and_a_trained_perception(baseline_run, semantic_run):
    with pytest.raises(UsageError):
        SemanticVectorObservation(gym.vector.SyncVectorEnv([raw]), baseline_run)
    with pytest.raises(UsageError):
        SemanticVectorObservation(gym.make_vec("CartPole-v1", num_envs=2), semantic_run)
    with pytest.raises(UsageError, match="begin anew by themselves"):
        never = gym.vector.SyncVectorEnv([raw], autoreset_mode=gym.vector.AutoresetMode.DISABLED)
        SemanticVectorObservation(never, semantic_run)


def test_tracked_scenes_are_drawn_as_labels(tracked_run):
    env = SemanticObservation(make_env(CATCH), tracked_run, "labels")
    env.reset(seed=0)
    drawn = [np.unique(env.step(i % 2)[0]) for i in range(12)]
    assert max(map(len, drawn)) > 1  # the background and an object's level


def test_slots_are_what_the_agent_sees_and_wrappers_share_no_tracks(objects_run):
    """At every decision of an episode that another wrapper of the same encoder interrupts."""
    player = load_player(objects_run)
    env, other = (SemanticObservation(make_env(CATCH), player.encoder) for _ in range(2))
    other.reset(seed=3)
    game, previous = player.new_game(4), None
    steps = list(player.play(game, np.random.default_rng(0)))
    observation, _ = env.reset(seed=int(game.to_arrays()["episode_seed"]))
    for step, after in zip(steps, [*steps[1:], None], strict=True):
        current = step.state.vector
        previous = current if previous is None else previous
        np.testing.assert_array_equal(observation, np.concatenate([current, current - previous]))
        previous = current
        other.step(1)
        if after is not None:
            observation, *_ = env.step(after.action)
    assert any(step.state.vector.any() for step in steps)


def test_every_number_of_a_vector_has_a_name(semantic_run, objects_run, tracked_run):
    for run in (semantic_run, objects_run, tracked_run):
        env = SemanticObservation(make_env(CATCH), run)
        names = env.feature_names
        assert len(set(names)) == len(names) == env.observation_space.shape[0]
        assert set(load_encoder(run).space.names) <= set(names)
    assert SemanticObservation(make_env(CATCH), objects_run, "labels").feature_names == ()
    env = SemanticObservation(make_env(CATCH), objects_run)
    seen, _ = env.reset(seed=0)
    told = dict(zip(env.feature_names, seen.tolist(), strict=True))
    assert told == {name: told[name] for name in env.feature_names} and told["change of free slot 0"] == 0


def test_tracked_objects_are_drawn_as_labels_too(objects_run):
    labels, _ = SemanticObservation(make_env(CATCH), objects_run, "labels").reset(seed=0)
    assert labels.any()


def test_perception_of_another_game_is_refused(objects_run):
    encoder = load_encoder(objects_run)
    encoder.rom = "breakout"
    with pytest.raises(UsageError, match="has learned to see breakout, not pong"):
        SemanticObservation(make_env(), encoder)
    with pytest.raises(UsageError, match="has learned to see breakout, not pong"):
        SemanticVectorObservation(gym.vector.SyncVectorEnv([make_env] * 2), encoder)
