"""Deep Q-learning learns: Catch from its coordinates, and from the scenes that perception makes of its frames."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch

from semrl.agents import DQN, DQNConfig, NetworkConfig
from semrl.core import AgentObservation, StateSpace
from semrl.envs import Game, make_env
from semrl.envs.catch import Catch
from semrl.envs.environment import FrameSkip
from semrl.perception.config import PerceptionConfig
from semrl.perception.embedding import HashedEmbeddingConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.training import preset
from semrl.training.trainer import Trainer

QUICK = DQNConfig(
    exploration_decisions=2_500,
    learning_rate=1e-3,
    adam_beta1=0.9,
    batch_size=64,
    replay_capacity=20_000,
    learning_starts=500,
    train_freq=1,
    n_steps=5,
    discount=0.95,
    double=True,
    tau=0.01,
    target_update_interval=1,
    network=NetworkConfig(hidden_units=(64, 64)),
)


@pytest.fixture(autouse=True)
def _one_thread():
    """Small networks are faster, and repeat exactly, in one thread."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def play(env: gym.Env, choose, seed, observe=None):
    """Play one episode; return its return and what the agent is shown at its end."""
    current, _ = env.reset(seed=seed)
    shown, total, done, start = AgentObservation(vectors=np.stack([current, current])), 0.0, False, True
    while not done:
        action = choose(shown)
        following, reward, terminated, truncated, _ = env.step(action)
        if observe:
            observe(shown, action, reward, terminated=terminated, start=start)
        shown, current = AgentObservation(vectors=np.stack([following, current])), following
        total += reward
        start, done = False, terminated or truncated
    return total, shown


def mean_return(env, choose, episodes=20):
    return float(np.mean([play(env, choose, 10**6 + i)[0] for i in range(episodes)]))


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (1, 2))])
def test_dqn_learns_to_catch_every_ball(seed):
    env = FrameSkip(Catch(observation="vector"), 4)
    agent = DQN(QUICK, space=StateSpace(shape=(4,)), n_actions=2, seed=seed)
    assert mean_return(env, agent.best_action) < -1
    best = -5.0
    for episode in range(1, 221):  # 45 decisions each
        agent.end_episode(play(env, agent.act, seed * 1000 + episode, agent.observe)[1])
        if episode >= 120 and episode % 20 == 0:
            best = max(best, mean_return(env, agent.best_action))
            if best >= 4.5:
                break
    assert best >= 4.5  # of 5


def test_an_agent_without_rewards_learns_nothing():
    """What the test above measures can fail."""
    env = FrameSkip(Catch(observation="vector"), 4)
    agent = DQN(QUICK, space=StateSpace(shape=(4,)), n_actions=2, seed=0)

    def blind(shown, action, reward, **ends):
        agent.observe(shown, action, 0.0, **ends)

    for episode in range(40):
        agent.end_episode(play(env, agent.act, episode, blind)[1])
    assert mean_return(env, agent.best_action) < 1


@pytest.mark.parametrize(
    ("share", "episodes", "least"), [(10, 300, 0.0), pytest.param(1, 900, 3.5, marks=pytest.mark.slow)]
)
def test_the_thesis_own_agent_learns_from_coordinates(share, episodes, least):
    """Every value is the preset's; at a tenth of its counts of decisions and, in minutes, with those unchanged."""
    settings = preset("thesis", "ram").dqn
    counts = ("exploration_decisions", "replay_capacity", "learning_starts", "target_update_interval")
    settings = replace(settings, **{name: getattr(settings, name) // share for name in counts})
    env = FrameSkip(Catch(observation="vector"), 4)
    agent = DQN(settings, space=StateSpace(shape=(4,)), n_actions=2, seed=0)
    assert mean_return(env, agent.best_action) < -1
    for episode in range(episodes):
        agent.end_episode(play(env, agent.act, episode, agent.observe)[1])
    assert mean_return(env, agent.best_action) > least


@pytest.mark.slow
def test_dqn_learns_to_catch_from_scenes():
    """The whole upper line of the architecture: frames, objects, kinds, scene graph, vector, agent."""
    config = PerceptionConfig(embedder="hashed", hashed=HashedEmbeddingConfig(dimension=512))
    stability = StabilityConfig(batches=30)
    encoder = ENCODERS.load("scene")(config)
    settings = replace(QUICK, learning_rate=5e-4, network=NetworkConfig(hidden_units=(128,), layer_norm=True))
    agent = DQN(settings, space=encoder.space, n_actions=2, seed=0)
    trainer = Trainer(
        Game(make_env("semrl/Catch-v0"), 0),
        encoder,
        PretrainingSchedule(encoder.stages(stability), stability),
        agent,
        decisions=10_000,
        seed=0,
    )
    trainer.run()
    returns = np.array(trainer.returns_)
    assert returns[:20].mean() < -1
    assert returns[-20:].mean() > returns[:20].mean() + 1.5
