"""Somebody else's agent on states, plans and goals that are learned as it plays."""

from dataclasses import replace
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from semrl import SemanticEnv, make_env, preset
from semrl.core import StateSpace
from semrl.core.arrays import digest
from semrl.core.errors import SemrlError, UsageError

QUICK = {
    "perception": {"foreground": {"background_frames": 20}, "slot_assigner": {"frames": 40}},
    "stability": {"decisions": 80, "batches": 10, "max_batches": 40},
    "planning": {"scenarios": {"depth": 4, "scenarios": 8}, "trees": {"first_decisions": 60, "new_decisions": 30}},
}


def new_env(model="objects-map", **keywords):
    return SemanticEnv(make_env("semrl/Catch-v0"), preset("semrl", model, QUICK), **keywords)


def play(env, decisions, seed=0):
    rng, shown = np.random.default_rng(seed), [env.reset(seed=seed)[0]]
    for _ in range(decisions):
        seen, _, terminated, truncated, _ = env.step(int(rng.integers(env.action_space.n)))
        shown.append(seen)
        if terminated or truncated:
            shown.append(env.reset()[0])
    return shown


@pytest.fixture(scope="module")
def played():
    env = new_env()
    return env, play(env, 200)


def test_perception_is_ready_before_the_first_episode(played):
    env, shown = played
    assert env.pretraining_decisions == 80 and env.encoder.is_fitted
    assert env.feature_names and any(name.endswith(" x") for name in env.feature_names)
    assert all(env.observation_space.contains(seen) for seen in shown)


def test_states_are_told_with_their_change(played):
    _, shown = played
    d = len(shown[0]["state"]) // 2
    assert not shown[0]["state"][d:].any()  # nothing came before the first
    for before, after in pairwise(shown[:31]):
        if after["state"][d:].any():
            np.testing.assert_allclose(after["state"][d:], after["state"][:d] - before["state"][:d], atol=1e-6)


def test_map_model_and_rules_are_learned_from_whoever_plays(played):
    env, shown = played
    assert len(env.planning.state_map.graph_) > 10 and env.planning.world_model.is_fitted
    assert env.record is not None and env.record.plan is not None
    assert any(seen["plan"].any() for seen in shown)
    assert {rule.about for rule in env.rules(most=2)}


def test_a_goal_is_a_place_on_the_map_once_a_gain_was_met():
    env = new_env()
    shown = play(env, 400, seed=3)
    graph, goals = env.planning.state_map.graph_, [seen["goal"] for seen in shown if seen["goal"][0]]
    assert (graph.rewards > 0).any() and goals
    assert all(not seen["goal"].any() for seen in shown if not seen["goal"][0])
    assert set(np.unique([goal[0] for goal in goals])) == {1.0}


def test_plans_can_be_left_out_and_everything_is_learned_all_the_same():
    env = new_env(plan=False)
    shown = play(env, 120)
    assert set(shown[0]) == {"state"} and env.record is None
    assert len(env.planning.state_map.graph_) and env.planning.world_model.is_fitted


def test_without_learning_nothing_changes():
    env = new_env(learn=False)
    before = digest(env.planning.inference_arrays())
    play(env, 120)
    assert digest(env.planning.inference_arrays()) == before


def test_the_same_seed_shows_the_same():
    first, second = (play(new_env(), 60) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert digest(one) == digest(other)


def test_saved_and_loaded_it_goes_on_as_if_nothing_had_happened(tmp_path):
    env = new_env()
    play(env, 100)
    env.reset(seed=5)
    env.save(tmp_path / "learned.npz")
    again = SemanticEnv.load(tmp_path / "learned.npz", make_env("semrl/Catch-v0"))
    assert again.config == env.config and again.pretraining_decisions == 80
    for one, other in zip(play(env, 80, seed=9), play(again, 80, seed=9), strict=True):
        assert digest(one) == digest(other)


@pytest.mark.parametrize("content", [b"", b"nothing", None])
def test_what_is_no_saved_environment_is_refused(tmp_path, content):
    path = tmp_path / "file.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SemrlError):
        SemanticEnv.load(path, make_env("semrl/Catch-v0"))


def test_images_are_shown_as_channels_and_need_facts_for_a_plan():
    with pytest.raises(UsageError, match="needs facts"):
        SemanticEnv(make_env("semrl/Catch-v0"), preset("semrl", "baseline"))
    with pytest.raises(UsageError, match="reset before step"):
        new_env().step(0)


class Unpaid(gym.Wrapper):
    """Brings no number at its third decision."""

    decisions = 0

    def step(self, action):
        self.decisions += 1
        shown, reward, *rest = super().step(action)
        return shown, np.nan if self.decisions == 83 else reward, *rest


def test_a_reward_that_is_no_number_is_refused_before_anything_is_learned_from_it():
    env = SemanticEnv(Unpaid(make_env("semrl/Catch-v0")), preset("semrl", "objects-map", QUICK))
    env.env.decisions = 80
    env.reset(seed=0)
    for _ in range(2):
        env.step(0)
    with pytest.raises(UsageError, match="gave the reward nan for decision 2"):
        env.step(0)
    assert env.step(1)[1] == 0


def test_a_world_model_of_things_needs_things():
    lifted = {"planning": {**QUICK["planning"], "world_model": "lifted"}}
    with pytest.raises(UsageError, match="needs things that are followed"):
        SemanticEnv(make_env("PongNoFrameskip-v4"), preset("semrl", "ram-map", {**QUICK, **lifted}))


def test_facts_without_names_are_numbered():
    space = StateSpace(shape=(2,), n_facts=2)
    assert space.fact_names == ("number 0", "number 1") and replace(space, names=("x",)).fact_names == ("x",)


def test_gymnasium_finds_nothing_wrong():
    with pytest.warns(UserWarning):  # bounds are infinite, which it thinks odd
        check_env(new_env(), skip_render_check=True)


def test_stable_baselines_learns_on_it():
    sb3 = pytest.importorskip("stable_baselines3")
    env = new_env()
    agent = sb3.PPO("MultiInputPolicy", env, n_steps=32, batch_size=32, n_epochs=1, seed=0)
    agent.learn(64)
    assert agent.num_timesteps == 64 and env.planning.world_model.is_fitted
    assert isinstance(env.observation_space, gym.spaces.Dict)
