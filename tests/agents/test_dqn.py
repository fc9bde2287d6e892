"""Deep Q-learning, its targets worked out by hand."""

import numpy as np
import pytest
import torch

from semrl.agents import DQN, DQNConfig, NetworkConfig
from semrl.agents.devices import pick_device
from semrl.agents.replay import Batch
from semrl.core import AgentObservation, StateSpace
from semrl.core.arrays import digest, unnest
from semrl.core.errors import SemrlError, UsageError

SMALL = NetworkConfig(hidden_units=(16,))


def agent_with(seed=0, shape=(3,), n_actions=2, plan_size=0, **settings):
    settings = {"network": SMALL, "replay_capacity": 200, "learning_starts": 20, "train_freq": 2, **settings}
    return DQN(
        DQNConfig(**settings), space=StateSpace(shape=shape), n_actions=n_actions, seed=seed, plan_size=plan_size
    )


def shown(observation, previous=None, plan=()):
    """What an agent is shown; at the beginning of an episode there is no previous observation."""
    vectors = np.stack([observation, observation if previous is None else previous])
    return AgentObservation(vectors=vectors, plan=np.array(plan, np.float32))


def live(agent, decisions, seed=0, episode=9, start=0):
    """A life among random observations; every episode's end is a terminal one or a time limit, in turn."""
    rng = np.random.default_rng(seed)
    observations = rng.normal(size=(start + decisions + 1, *agent.replay.latest(1)[0].shape[2:])).astype(np.float32)
    rewards = rng.integers(-3, 4, size=start + decisions)
    plans = rng.normal(size=(start + decisions + 1, agent.replay.to_arrays()["plans"].shape[1])).astype(np.float32)
    for i in range(start, start + decisions):
        first, last = i % episode == 0, i % episode == episode - 1
        now = shown(observations[i], None if first else observations[i - 1], plans[i])
        action = agent.act(now)
        terminated = last and i // episode % 2 == 0
        agent.observe(now, action, float(rewards[i]), terminated=terminated, start=first)
        if last:
            agent.end_episode(shown(observations[i + 1], observations[i], plans[i + 1]))
    return agent


def test_learning_rate_and_exploration_fall_through_the_second_half_of_the_budget():
    settings = {"network": SMALL, "learning_rate": 1e-3, "final_learning_rate": 0.1, "learning_starts": 20}
    settings |= {"exploration_decisions": 10, "exploration_min": 0.02, "final_exploration": 0.0}
    agent = DQN(DQNConfig(**settings), space=StateSpace(shape=(3,)), n_actions=2, seed=0, budget=100)
    rates, explored = [], []
    for i in range(11):
        rates.append(agent.learning_rate)
        explored.append(agent.exploration)
        live(agent, 10, start=10 * i)
    assert rates[:6] == [1e-3] * 6
    assert rates[6:] == pytest.approx([8.2e-4, 6.4e-4, 4.6e-4, 2.8e-4, 1e-4])
    assert explored == pytest.approx([1.0, *[0.02] * 5, 0.016, 0.012, 0.008, 0.004, 0.0])
    assert agent.learning_rate == pytest.approx(1e-4)  # beyond the budget


def test_without_a_budget_learning_rate_and_least_exploration_stay():
    agent = live(agent_with(final_learning_rate=0.1, final_exploration=0.0, exploration_decisions=10), 40)
    assert agent.learning_rate == DQNConfig().learning_rate
    assert agent.exploration == pytest.approx(DQNConfig().exploration_min)


def copied(arrays):
    return {name: array.copy() for name, array in arrays.items()}


def one_transition(discount, seed=0, shape=(3,), reward=0.7, advised=-1):
    rng = np.random.default_rng(seed)
    states, next_states = rng.normal(size=(2, 1, 2, *shape)).astype(np.float32)
    return Batch(
        states=states,
        plans=np.zeros((1, 0), np.float32),
        actions=np.array([1]),
        returns=np.array([reward], np.float32),
        next_states=next_states,
        next_plans=np.zeros((1, 0), np.float32),
        discounts=np.array([discount], np.float32),
        advised=np.array([advised]),
    )


def values(network, states):
    with torch.no_grad():
        return network(torch.from_numpy(states), torch.zeros(len(states), 0)).numpy()[0].astype(float)


def huber(error):
    return error**2 / 2 if abs(error) < 1 else abs(error) - 0.5


def unequal_networks(**settings):
    """An agent whose online and target networks prefer different actions in the next state."""
    agent = agent_with(n_actions=4, **settings)
    for seed in range(1, 100):
        agent.from_arrays(agent_with(seed=seed, n_actions=4).inference_arrays())
        online, target = (values(n, one_transition(1.0).next_states) for n in (agent.network, agent.target))
        if online.argmax() != target.argmax():
            return agent, online, target
    raise AssertionError("no such networks")


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("discount", [0.99, 0.99**3, 0.0])
@pytest.mark.parametrize("reward", [0.7, 30.0])
def test_the_loss_is_that_of_the_target_by_hand(double, discount, reward):
    agent, online, target = unequal_networks(double=double)
    batch = one_transition(discount, reward=reward)
    value = target[online.argmax()] if double else target.max()
    error = values(agent.network, batch.states)[1] - (reward + discount * value)
    agent.update(batch)
    assert agent.loss_ == pytest.approx(huber(error), rel=1e-4, abs=1e-6)
    assert target[online.argmax()] != target.max()


@pytest.mark.parametrize("advised", [-1, 0, 1, 3])
def test_an_advised_action_should_exceed_all_others_by_the_margin(advised):
    plain, told = (agent_with(n_actions=4, advice_margin=0.3, advice_weight=weight) for weight in (0.0, 0.5))
    batch = one_transition(0.0, advised=advised)
    now = values(told.network, batch.states)
    missed = 0.0 if advised < 0 else (now + 0.3 * (np.arange(4) != advised)).max() - now[advised]
    for agent in (plain, told):
        agent.update(batch)
    assert told.loss_ == pytest.approx(plain.loss_ + 0.5 * missed, rel=1e-4) and (missed > 0) == (advised >= 0)


def test_advice_is_remembered_and_comes_to_be_followed():
    agent = agent_with(n_actions=3, advice_margin=0.1, advice_weight=1.0, learning_rate=1e-2, adam_beta1=0.9)
    rng = np.random.default_rng(0)
    observations = rng.normal(size=(200, 3)).astype(np.float32)
    best = observations.argmax(axis=1)
    for i, observation in enumerate(observations):
        advised = int(best[i]) if i % 2 else None  # half of the time there is no plan
        agent.observe(shown(observation), int(rng.integers(3)), 0.0, terminated=False, start=i == 0, advised=advised)
    for _ in range(400):
        agent.update(agent.replay.sample(rng, 32, n_steps=1, discount=0.0))
    assert np.mean([agent.best_action(shown(o)) == b for o, b in zip(observations, best, strict=True)]) > 0.85


def test_an_update_moves_the_value_towards_the_target():
    agent = agent_with(learning_rate=1e-2, adam_beta1=0.9, target_update_interval=10**6)
    batch = one_transition(0.0)
    before = abs(values(agent.network, batch.states)[1] - 0.7)
    for _ in range(400):
        agent.update(batch)
    assert abs(values(agent.network, batch.states)[1] - 0.7) < 0.01 < before


def test_two_step_targets_reach_the_next_network_value_after_two_rewards():
    agent = agent_with(n_steps=2, discount=0.5, batch_size=64, clip_rewards=False, learning_starts=10**6)
    observations = np.eye(3, dtype=np.float32)
    for i, reward in enumerate([1.0, 4.0]):
        agent.observe(shown(observations[i]), 0, reward, terminated=False, start=i == 0)
    agent.end_episode(shown(observations[2]))
    batch = agent.replay.sample(np.random.default_rng(0), 64, n_steps=2, discount=0.5)
    first = batch.states[:, 0, 0] == 1
    assert set(batch.returns[first]) == {3.0} and set(batch.discounts[first]) == {0.25}
    assert set(batch.returns[~first]) == {4.0} and set(batch.discounts[~first]) == {0.5}
    assert (batch.next_states[:, 0, 2] == 1).all()


def test_exploration_falls_exponentially_with_decisions_down_to_its_minimum():
    agent = agent_with(exploration_decisions=100, learning_starts=10**6)
    explored = []
    for _ in range(4):
        explored.append(agent.exploration)
        live(agent, 50)
    assert explored == pytest.approx([1.0, np.sqrt(1.0 * 0.01), 0.01, 0.01])


def test_the_thesis_settings():
    c = DQNConfig()
    assert (c.exploration_decisions, c.exploration_max, c.exploration_min) == (30_000, 1.0, 0.01)
    assert (c.learning_rate, c.adam_beta1, c.adam_beta2) == (1e-4, 0.99, 0.999)
    assert (c.train_freq, c.target_update_interval) == (1, 1000)
    assert (c.batch_size, c.replay_capacity, c.learning_starts, c.discount) == (32, 100_000, 10_000, 0.99)


def test_exploration_decides_between_chance_and_the_best_action():
    state = shown(np.ones(3, np.float32))
    greedy = agent_with(exploration_max=1e-12, exploration_min=1e-12, n_actions=4)
    assert {greedy.act(state) for _ in range(50)} == {greedy.best_action(state)}
    assert greedy.best_action(state) == values(greedy.network, state.vectors[None]).argmax()
    counts = np.bincount([agent_with(seed=s, n_actions=4).act(state) for s in range(400)], minlength=4)
    assert counts.min() > 60


def test_learning_begins_with_the_initial_buffer_and_keeps_its_pace():
    agent = agent_with(learning_starts=20, train_freq=5)
    updates = []
    for i in range(31):
        live(agent, 1, start=i)
        updates.append(agent.updates_)
    assert updates[18] == 0 and updates[19] == 1 and updates[23] == 1 and updates[24] == 2 and updates[30] == 3


def weights(module):
    return np.concatenate([p.detach().numpy().ravel() for p in module.parameters()])


def test_hard_renewal_copies_the_network_now_and_then():
    agent = agent_with(target_update_interval=3, learning_rate=1e-2)
    first = weights(agent.target).copy()
    for i in range(1, 7):
        agent.update(one_transition(0.9, seed=i))
        if i < 3:
            np.testing.assert_array_equal(weights(agent.target), first)
        assert np.array_equal(weights(agent.target), weights(agent.network)) == (i % 3 == 0)


def test_soft_renewal_takes_over_a_share_each_time():
    agent = agent_with(target_update_interval=1, tau=0.1, learning_rate=1e-2)
    for i in range(5):
        before = weights(agent.target).copy()
        agent.update(one_transition(0.9, seed=i))
        np.testing.assert_allclose(weights(agent.target), 0.9 * before + 0.1 * weights(agent.network), atol=1e-6)


def test_divergence_is_told_in_one_line():
    agent = agent_with()
    with pytest.raises(SemrlError, match=r"loss is nan after 0 updates.*learning-rate"):
        agent.update(one_transition(0.9, reward=np.nan))


@pytest.mark.parametrize(("clip", "expected"), [(True, {-1.0, 0.0, 1.0}), (False, set(map(float, range(-3, 4))))])
def test_rewards_are_clipped_to_their_sign(clip, expected):
    agent = live(agent_with(clip_rewards=clip, learning_starts=10**6), 150)
    assert set(agent.to_arrays()["replay/rewards"].tolist()) == expected


FULL = {
    "plain": {},
    "everything": {
        "double": True, "n_steps": 3, "reward_share": 0.25, "tau": 0.1, "target_update_interval": 1,
        "heads": 3, "head_decisions": 5,
        "network": NetworkConfig(hidden_units=(16, 16), layer_norm=True, normalise_input=True),
    },
}  # fmt: skip


@pytest.mark.parametrize("settings", FULL.values(), ids=FULL)
@pytest.mark.parametrize("decisions", [5, 20, 61, 400])
def test_restored_it_goes_on_bit_for_bit(settings, decisions):
    straight = live(agent_with(plan_size=2, **settings), decisions)
    saved = copied(straight.to_arrays())
    restored = agent_with(seed=9, plan_size=2, **settings)
    restored.from_arrays(saved)
    assert digest(restored.to_arrays()) == digest(saved)
    for agent in (straight, restored):
        live(agent, 80, start=decisions)
    assert straight.updates_ > 20
    assert digest(straight.to_arrays()) == digest(restored.to_arrays())


@pytest.mark.parametrize("settings", FULL.values(), ids=FULL)
def test_of_the_weights_alone_it_plays_the_same(settings):
    learned = live(agent_with(plan_size=2, **settings), 100)
    player = agent_with(seed=9, plan_size=2, **settings)
    player.from_arrays(copied(learned.inference_arrays()))
    assert set(learned.inference_arrays()) <= set(learned.to_arrays())
    for seed in range(5):
        rng = np.random.default_rng(seed)
        state = shown(*rng.normal(size=(2, 3)).astype(np.float32), rng.normal(size=2))
        np.testing.assert_array_equal(player.action_values(state), learned.action_values(state))
        assert player.best_action(state) == learned.best_action(state)
    assert not len(player.replay) and player.decisions_ == 0


def test_a_plan_can_be_learned_from():
    """The same state, and a plan that tells which action pays."""
    agent = agent_with(plan_size=2, learning_rate=1e-2, adam_beta1=0.9, learning_starts=10**6)
    rng, state = np.random.default_rng(0), np.ones(3, np.float32)
    for i in range(200):
        told, action = np.eye(2)[i % 2], int(rng.integers(2))
        agent.observe(shown(state, plan=told), action, float(told[action]), terminated=True, start=True)
    for _ in range(200):
        agent.update(agent.replay.sample(rng, 32, n_steps=1, discount=0.9))
    assert [agent.best_action(shown(state, plan=told)) for told in np.eye(2)] == [0, 1]


def test_the_next_plan_is_that_of_the_next_state():
    """Its value is asked with the plan that was made there."""
    agent = agent_with(plan_size=1, discount=0.5, target_update_interval=10**6, batch_size=4, learning_starts=10**6)
    state = np.ones(3, np.float32)
    agent.observe(shown(state, plan=[0.25]), 1, 1.0, terminated=False, start=True)
    agent.end_episode(shown(state, state, [4.0]))
    with torch.no_grad():
        now, after = torch.tensor([[[1.0] * 3] * 2]), torch.tensor([[[1.0] * 3] * 2])
        value = agent.network(now, torch.tensor([[0.25]]))[0, 1]
        target = 1 + 0.5 * agent.target(after, torch.tensor([[4.0]])).max()
    agent.update(agent.replay.sample(np.random.default_rng(0), 4, n_steps=1, discount=0.5))
    assert agent.loss_ == pytest.approx(huber(float(value - target)), rel=1e-4)


def test_a_device_that_is_not_there_is_told():
    missing = "mps" if torch.cuda.is_available() else "cuda"
    with pytest.raises(UsageError, match=f"device '{missing}' is not there; this machine has cpu"):
        pick_device(missing)
    assert pick_device("cpu") == torch.device("cpu")
    assert pick_device("auto").type in ("cpu", "cuda", "mps")


def test_the_same_seed_learns_the_same():
    one, two, other = (live(agent_with(seed=s), 100) for s in (0, 0, 1))
    assert digest(one.to_arrays()) == digest(two.to_arrays()) != digest(other.to_arrays())


def test_images_are_learned_from_as_well():
    config = DQNConfig(replay_capacity=50, learning_starts=10, train_freq=5, batch_size=4)
    images = StateSpace(shape=(84, 84), dtype=np.uint8)
    agent = DQN(config, space=images, n_actions=2, seed=0)
    frames = np.random.default_rng(0).integers(256, size=(16, 84, 84), dtype=np.uint8)
    for i in range(15):
        agent.observe(shown(frames[i]), i % 2, 1.0, terminated=False, start=i == 0)
    assert agent.updates_ == 2 and np.isfinite(agent.loss_)
    saved = copied(agent.to_arrays())
    restored = DQN(config, space=images, n_actions=2, seed=5)
    restored.from_arrays(saved)
    for a in (agent, restored):
        for i in range(10):
            a.observe(shown(frames[i]), i % 2, -1.0, terminated=False, start=False)
    assert digest(agent.to_arrays()) == digest(restored.to_arrays())


def test_the_normaliser_is_measured_once_on_the_initial_buffer():
    network = NetworkConfig(hidden_units=(16,), normalise_input=True)
    agent = live(agent_with(network=network, learning_starts=50), 49)
    assert (agent.to_arrays()["network/state_input.scale"] == 1).all()
    live(agent, 1, start=49)
    states = agent.replay.latest(50)[0]
    mean = np.stack([states[:, 0], states[:, 0] - states[:, 1]], axis=1).mean(axis=0)
    for name in ("network", "target"):
        np.testing.assert_allclose(agent.to_arrays()[f"{name}/state_input.mean"], mean, atol=1e-5)
    measured = copied(unnest(agent.to_arrays(), "network"))["state_input.mean"]
    live(agent, 60, start=50)
    np.testing.assert_array_equal(agent.to_arrays()["network/state_input.mean"], measured)


def test_one_head_is_followed_until_a_reward_or_for_a_while():
    agent = agent_with(heads=8, head_decisions=20, exploration_max=1e-12, exploration_min=1e-12, learning_starts=10**6)
    state = shown(np.ones(3, np.float32))
    heads = np.array(
        [agent.network(torch.ones(1, 2, 3), torch.zeros(1, 0)).detach().numpy().reshape(8, -1).argmax(axis=1)]
    )[0]
    followed = []
    for i in range(2000):
        followed.append(int(agent.to_arrays()["head"]))
        assert agent.act(state) == heads[followed[-1]]
        agent.observe(state, 0, 0.0, terminated=False, start=i == 0)
    changes = (np.diff(followed) != 0).mean()
    assert changes == pytest.approx(7 / 8 / 20, rel=0.3) and set(followed) == set(range(8))


def test_heads_give_way_to_their_mean_in_the_second_half():
    agent = agent_with(heads=8, ensemble_share=1.0, exploration_max=1e-12, exploration_min=1e-12, learning_starts=10**6)
    agent.budget = 100
    state = shown(np.ones(3, np.float32))
    heads = agent.network(torch.ones(1, 2, 3), torch.zeros(1, 0)).detach().numpy().reshape(8, -1)
    agent._head = int(np.flatnonzero(heads.argmax(axis=1) != agent.best_action(state))[0])  # one that differs
    shares = []
    for agent.decisions_ in (0, 50, 75, 100):
        acts = [agent.act(state) for _ in range(200)]
        assert set(acts) <= {heads[agent._head].argmax(), agent.best_action(state)}
        shares.append(np.mean(np.array(acts) == agent.best_action(state)))
    assert shares[:2] == [0, 0] and 0.3 < shares[2] < 0.7 and shares[3] == 1


def test_heads_learn_their_own_values_and_play_by_their_mean():
    agent = live(agent_with(heads=5, learning_rate=1e-2), 200)
    state = shown(np.ones(3, np.float32))
    by_head = agent.network(torch.from_numpy(state.vectors[None]), torch.zeros(1, 0)).detach().numpy().reshape(5, -1)
    assert (np.ptp(by_head, axis=0) > 0).all()
    np.testing.assert_allclose(agent.action_values(state), by_head.mean(axis=0), rtol=1e-5)


@pytest.mark.parametrize(
    "settings",
    [
        {"heads": 0}, {"batch_size": 0}, {"learning_rate": 0.0}, {"learning_rate": float("nan")}, {"discount": 1.5},
        {"exploration_min": 0.5, "exploration_max": 0.1}, {"replay_capacity": 3, "n_steps": 3},
        {"learning_starts": 1},
        {"tau": 0.0}, {"adam_epsilon": float("inf")}, {"reward_share": -0.1}, {"adam_beta1": 1.0},
    ],
)  # fmt: skip
def test_impossible_settings_are_refused(settings):
    with pytest.raises(UsageError, match=rf"dqn\.{next(iter(settings))}"):
        DQNConfig(**settings)
