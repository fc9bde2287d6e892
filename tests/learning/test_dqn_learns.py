"""Deep Q-learning learns: Catch from its coordinates, and from the scenes that perception makes of its frames."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch

from semrl.agents import DQN, DQNConfig, NetworkConfig
from semrl.envs import Game, make_env
from semrl.envs.catch import Catch
from semrl.envs.environment import FrameSkip
from semrl.perception.config import PipelineConfig
from semrl.perception.embedding import HashedEmbeddingConfig
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.training.trainer import Trainer

QUICK = DQNConfig(
    exploration_decisions=543,
    learning_rate=1e-3,
    adam_beta1=0.9,
    batch_size=64,
    replay_capacity=20_000,
    initial_buffer=500,
    decisions_per_update=1,
    n_steps=5,
    discount=0.95,
    double=True,
    target_rate=0.01,
    target_updates=1,
    network=NetworkConfig(hidden_units=(64, 64)),
)


@pytest.fixture(autouse=True)
def _one_thread():
    """Small networks are faster, and repeat exactly, in one thread."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def play(env: gym.Env, encode, choose, seed, observe=None):
    """Play one episode; return its return. ``encode`` maps an observation to what the agent sees."""
    current = encode(env.reset(seed=seed)[0])
    previous, total, done, start = current, 0.0, False, True
    while not done:
        action = choose(np.stack([current, previous]))
        observation, reward, terminated, truncated, _ = env.step(action)
        if observe:
            observe(current, action, reward, terminated=terminated, start=start)
        previous, current = current, encode(observation)
        total += reward
        start, done = False, terminated or truncated
    return total, current


def mean_return(env, encode, choose, episodes=20):
    return float(np.mean([play(env, encode, choose, 10**6 + i)[0] for i in range(episodes)]))


@pytest.mark.parametrize("seed", range(3))
def test_dqn_learns_to_catch_every_ball(seed):
    env = FrameSkip(Catch(observation="vector"), 4)
    agent = DQN(QUICK, (4,), np.float32, 2, seed=seed)
    assert mean_return(env, np.asarray, agent.best_action) < -1
    best = -5.0
    for episode in range(1, 221):  # 45 decisions each
        agent.end_episode(play(env, np.asarray, agent.act, seed * 1000 + episode, agent.observe)[1])
        if episode >= 120 and episode % 20 == 0:
            best = max(best, mean_return(env, np.asarray, agent.best_action))
            if best >= 4.5:
                break
    assert best >= 4.5  # of 5


def test_an_agent_without_rewards_learns_nothing():
    """What the test above measures can fail."""
    env = FrameSkip(Catch(observation="vector"), 4)
    agent = DQN(QUICK, (4,), np.float32, 2, seed=0)

    def blind(observation, action, reward, **ends):
        agent.observe(observation, action, 0.0, **ends)

    for episode in range(40):
        agent.end_episode(play(env, np.asarray, agent.act, episode, blind)[1])
    assert mean_return(env, np.asarray, agent.best_action) < 1


@pytest.mark.slow
def test_dqn_learns_to_catch_from_scenes():
    """The whole upper line of the architecture: frames, objects, kinds, scene graph, vector, agent."""
    config = PipelineConfig(embedding="hashed", hashed=HashedEmbeddingConfig(dimension=512))
    pipeline = Pipeline(config, "embedding")
    settings = replace(QUICK, learning_rate=5e-4, network=NetworkConfig(hidden_units=(128,), layer_norm=True))
    agent = DQN(settings, pipeline.shape, pipeline.dtype, 2, seed=0)
    trainer = Trainer(
        Game(make_env("semrl/Catch-v0"), 0), pipeline, Schooling(pipeline, StabilityConfig(batches=30)), agent,
        decisions=10_000, seed=0,
    )  # fmt: skip
    trainer.run()
    returns = np.array(trainer.returns_)
    assert returns[:20].mean() < -1
    assert returns[-20:].mean() > returns[:20].mean() + 1.5
