"""The Q-network in compiled code is PyTorch's, forwards and backwards."""

import dataclasses

import numpy as np
import pytest
import torch

from semrl.agents import DQN, DQNConfig, NetworkConfig
from semrl.agents.torch_updates import TorchUpdates
from semrl.agents.vector_network import VectorNetwork
from semrl.agents.vector_updates import VectorUpdates
from semrl.core import AgentObservation, StateSpace
from semrl.core.arrays import unnest
from semrl.core.errors import SemrlError

SIZE, ACTIONS = 5, 3
NETWORKS = [
    NetworkConfig(hidden_units=(16,)),
    NetworkConfig(hidden_units=(24, 16), layer_norm=True, normalise_input=True, frequencies=4),
    NetworkConfig(hidden_units=(8, 12, 8), frequencies=2),
    NetworkConfig(hidden_units=()),
]
RICH = {"heads": 4, "double": True, "advice_margin": 0.05, "advice_weight": 0.3, "tau": 0.1}


def agent_of(network, plan_size=2, **settings):
    settings = {"learning_starts": 40, "batch_size": 16, "replay_capacity": 400, "n_steps": 3} | settings
    config = DQNConfig(network=network, learning_rate=1e-3, target_update_interval=3, **settings)
    return DQN(config, space=StateSpace(shape=(SIZE,)), n_actions=ACTIONS, seed=1, plan_size=plan_size, budget=500)


def observations(count, seed, plan_size):
    rng = np.random.default_rng(seed)
    now = rng.random(SIZE, np.float32)
    for _ in range(count):
        before, now = now, (now + rng.normal(0, 0.1, SIZE)).astype(np.float32)
        now[0] = 0.25  # never varies
        yield AgentObservation(vectors=np.stack([now, before]), plan=rng.random(plan_size, np.float32)), rng


def play(agent, count, seed, plan_size):
    for i, (shown, rng) in enumerate(observations(count, seed, plan_size)):
        reward, advised = float(rng.integers(-1, 2)), int(rng.integers(ACTIONS)) if rng.random() < 0.6 else None
        end = i % 11 == 10
        action = int(rng.integers(ACTIONS))
        agent.observe(shown, action, reward, terminated=end, start=i % 11 == 0, advised=advised)


@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize("plan_size", [0, 2])
def test_one_state_and_many_have_the_values_of_pytorch_whatever_was_learned_meanwhile(network, plan_size):
    agent = agent_of(network, plan_size)
    for seed in range(3):
        play(agent, 60, seed, plan_size)
        compiled = VectorNetwork(agent.network)
        for shown, _ in observations(5, seed, plan_size):
            states, plans = shown.vectors[None], shown.plan[None]
            with torch.inference_mode():
                expected = agent.network(torch.from_numpy(states), torch.from_numpy(plans)).numpy()
            np.testing.assert_allclose(compiled.values(compiled.inputs(states, plans)), expected, rtol=0, atol=1e-6)
            np.testing.assert_allclose(agent.action_values(shown), expected[0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize("settings", [{}, RICH, RICH | {"double": False}])
def test_a_gradient_is_that_of_pytorch(network, settings):
    agent = agent_of(network, **settings)
    play(agent, 39, 0, 2)
    if network.normalise_input:
        for side in (agent.network, agent.target):
            side.state_input.fit(*(torch.from_numpy(x) for x in agent.replay.latest(39)))
    for _ in range(3):
        batch = agent._sample()
        loss, gradients = agent._updates.loss_and_gradients(batch)
        in_torch = TorchUpdates(agent.config, agent.network, agent.target, ACTIONS)
        assert loss == pytest.approx(in_torch.update(batch, 1e-3), abs=1e-6)  # leaves its gradients behind
        expected = [parameter.grad.numpy() for parameter in agent.network.parameters()]
        assert len(gradients) == len(expected)
        for gradient, other in zip(gradients, expected, strict=True):
            np.testing.assert_allclose(gradient, other, rtol=0, atol=1e-6)


@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize("settings", [{}, RICH])
def test_after_many_updates_the_networks_are_those_of_pytorch(network, settings):
    ours, theirs = agent_of(network, **settings), agent_of(network, **settings)
    theirs._updates = TorchUpdates(theirs.config, theirs.network, theirs.target, ACTIONS)
    for agent in (ours, theirs):
        play(agent, 240, 5, 2)
    assert ours.updates_ == theirs.updates_ == 201
    for side in ("network", "target"):
        for mine, other in zip(getattr(ours, side).parameters(), getattr(theirs, side).parameters(), strict=True):
            np.testing.assert_allclose(mine.detach(), other.detach(), rtol=0, atol=2e-5)  # 201 steps of up to 1e-3
    mine, other = (unnest(agent.to_arrays(), "optimiser") for agent in (ours, theirs))
    assert mine.keys() == other.keys() and mine["0/step"] == 201
    for name, moments in mine.items():
        np.testing.assert_allclose(moments, other[name], rtol=0, atol=1e-5, err_msg=name)


def test_what_was_learned_in_compiled_code_goes_on_in_pytorch():
    ours, theirs = agent_of(NETWORKS[1], **RICH), agent_of(NETWORKS[1], **RICH)
    theirs._updates = TorchUpdates(theirs.config, theirs.network, theirs.target, ACTIONS)
    play(ours, 120, 5, 2)
    theirs.from_arrays({name: array.copy() for name, array in ours.to_arrays().items()})
    for agent in (ours, theirs):
        play(agent, 60, 6, 2)
    for mine, other in zip(ours.network.parameters(), theirs.network.parameters(), strict=True):
        np.testing.assert_allclose(mine.detach(), other.detach(), rtol=0, atol=2e-5)


@pytest.mark.parametrize("before", [0, 35, 90])
def test_what_is_restored_goes_on_bit_for_bit(before):
    unbroken, restored = (agent_of(NETWORKS[1], **RICH) for _ in range(2))
    play(unbroken, before, 3, 2)
    arrays = {name: array.copy() for name, array in unbroken.to_arrays().items()}
    restored.from_arrays(arrays)
    for agent in (unbroken, restored):
        play(agent, 60, 4, 2)
    kept, again = unbroken.to_arrays(), restored.to_arrays()
    assert kept.keys() == again.keys()
    for name, array in kept.items():
        np.testing.assert_array_equal(array, again[name], err_msg=name)


@pytest.mark.parametrize("made_by", [TorchUpdates, VectorUpdates])
def test_a_loss_that_is_no_number_stops_learning_and_leaves_the_weights(made_by):
    agent = agent_of(NETWORKS[1], **RICH)
    agent._updates = made_by(agent.config, agent.network, agent.target, ACTIONS)
    play(agent, 39, 0, 2)
    before = [parameter.detach().clone() for parameter in agent.network.parameters()]
    batch = agent._sample()
    with pytest.raises(SemrlError, match="diverged"):
        agent.update(dataclasses.replace(batch, returns=np.full_like(batch.returns, np.nan)))
    assert all(torch.equal(old, new) for old, new in zip(before, agent.network.parameters(), strict=True))


def test_images_are_left_to_pytorch():
    space = StateSpace(shape=(84, 84), dtype=np.uint8)
    agent = DQN(DQNConfig(replay_capacity=20), space=space, n_actions=2, seed=0)
    assert isinstance(agent._updates, TorchUpdates)
