"""The lower line as a whole: a small world is played at random, learned, and then solved by plans alone."""

import dataclasses

import numpy as np
import pytest
import torch

from semrl.core import Moment, Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.grounding import GoalConfig
from semrl.planning import LongTermConfig, ShortTermConfig, plan_routes
from semrl.planning.module import MAP_MODELS, Reasoner, ReasoningConfig
from semrl.planning.state_map import StateMapConfig
from semrl.training.metrics import COLUMNS
from semrl.world_model import ModelPairConfig, NextStateConfig, NextStateNetwork, RewardConfig, TreesConfig

CELLS, N_ACTIONS, D = 10, 3, 2
CONFIG = ReasoningConfig(
    state_map=StateMapConfig(node_threshold=0.05, edge_threshold=0.05, reward_weight=10),
    models=ModelPairConfig(
        next_state=NextStateConfig(
            hidden_units=(32,), learning_rate=3e-3, batch_size=16, epochs=15, predict_change=True
        ),
        reward=RewardConfig(kind="network", hidden_units=(32,), learning_rate=1e-2, batch_size=16, epochs=15),
        rehearsal_states=5000,
    ),
    short_term=ShortTermConfig(depth=3),
    discount=0.9,
)
THESIS = ReasoningConfig(
    models=ModelPairConfig(next_state=NextStateConfig(hidden_units=(16,), epochs=3)),
    short_term=ShortTermConfig(depth=2),
)
TREES = dataclasses.replace(
    CONFIG, world="trees", trees=TreesConfig(members=2, resolution=0.5, first_decisions=30, new_decisions=10),
    short_term=ShortTermConfig(depth=6, scenarios=16), planner_every=2,
)  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def state_of(cell):
    return np.array([cell, 5 - cell / 2], np.float32)


def step(cell, action):
    """Go left, stay or go right in a corridor; its right end pays and is the end."""
    cell = int(np.clip(cell + action - 1, 0, CELLS - 1))
    return cell, float(cell == CELLS - 1)


def play(reasoner, rng, start, decisions=80):
    """An episode at random, as the trainer plays it; return what `end_episode` tells."""
    cell = start
    seen = reasoner.think(state_of(cell))[0]
    for _ in range(decisions):
        action = int(rng.integers(N_ACTIONS))
        cell, reward = step(cell, action)
        reasoner.observe(seen, action, reward)
        seen = reasoner.think(state_of(cell))[0]
        if reward:
            break
    return reasoner.end_episode(seen)


def random_trajectory(seed, decisions=60, offset=0.0):
    rng = np.random.default_rng(seed)
    states = np.cumsum(rng.normal(size=(decisions + 1, D)), axis=0) + offset
    return Trajectory(
        states=states.astype(np.float32),
        actions=rng.integers(N_ACTIONS, size=decisions),
        rewards=rng.choice([-1, 0, 0, 0, 1], size=decisions).astype(np.float32),
    )


def at(*states):
    """Where a plan begins: the present state, and those before it."""
    return Moment(states=np.stack(states))


def new(config=CONFIG, seed=0):
    return Reasoner(config, D, N_ACTIONS, seed=seed)


def copied(reasoner):
    return {name: array.copy() for name, array in reasoner.to_arrays().items()}


@pytest.fixture(scope="module")
def corridor():
    """A reasoner that has seen twenty random episodes of the corridor. Read only."""
    reasoner, rng = new(), np.random.default_rng(0)
    for _ in range(20):
        play(reasoner, rng, int(rng.integers(CELLS - 1)))
    return reasoner


def test_the_models_that_reason():
    assert MAP_MODELS == ("semantic-map", "ram-map", "objects-map")


def test_the_map_of_the_corridor_is_the_corridor(corridor):
    graph = corridor.state_map.graph_
    np.testing.assert_allclose(np.sort(graph.node_means[:, 0]), range(CELLS), atol=1e-6)
    cells = graph.node_means[:, 0].round().astype(int)
    for source, target, shares, reward in zip(graph.sources, graph.targets, graph.actions, graph.rewards, strict=True):
        assert step(cells[source], int(shares.argmax())) == (cells[target], pytest.approx(reward, abs=1e-9))
    assert cells[corridor.routes.goals].tolist() == [CELLS - 2]


def test_plans_alone_solve_the_corridor(corridor):
    solved = 0
    for start in range(CELLS - 1):
        cell, before, reward = start, start, 0.0
        for _ in range(20):
            if not reward:
                plan = corridor.plan(at(state_of(cell), state_of(before)))
                (cell, reward), before = step(cell, int(plan.actions[0])), cell
        solved += reward == 1
    assert solved >= 8


def test_a_plan_foresees_what_will_happen(corridor):
    plan = corridor.plan(at(state_of(7), state_of(7)))
    assert plan.actions[:2].tolist() == [2, 2]
    np.testing.assert_allclose(plan.scenarios.states[0, :2], [state_of(8), state_of(9)], atol=0.3)
    assert plan.scenarios.rewards[0, 1] == 1 and plan.returns[0] >= CONFIG.discount
    graph = corridor.state_map.graph_
    assert graph.node_means[plan.path][:, 0].round().tolist() == [7, 8]
    far = corridor.plan(at(state_of(1), state_of(1)))
    assert graph.node_means[far.path][:, 0].round().tolist() == list(range(1, 9))
    assert far.actions.tolist() == [2, 2, 2] and far.progress[0] == 3 and far.returns[0] == 0


def test_planning_learns_nothing(corridor):
    before = digest(corridor.to_arrays())
    moment = at(state_of(3), state_of(4))
    first, again = (corridor.goal(corridor.plan(moment)) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert digest(corridor.to_arrays()) == before
    assert moment.states.tolist() == [state_of(3).tolist(), state_of(4).tolist()]


def test_before_anything_was_learned_there_is_no_plan_and_the_goal_is_zero():
    reasoner = new()
    moment = at(state_of(3), state_of(4))
    assert reasoner.plan(moment) is None and reasoner.proposed_action is None
    goal = reasoner.goal(None)
    assert goal.dtype == np.float32 and goal.shape == (reasoner.goal_size,) and not goal.any()
    reasoner.learn(random_trajectory(0))
    assert reasoner.goal(reasoner.plan(moment)).any()


def test_what_the_agent_sees_is_the_state_and_the_goal(corridor):
    corridor.begin_episode()
    first, thought = corridor.think(state_of(4))
    assert thought.moment.states.tolist() == [state_of(4).tolist()]
    assert corridor.proposed_action == thought.plan.actions[0]
    assert first[:D].tolist() == state_of(4).tolist() and first.dtype == np.float32
    np.testing.assert_array_equal(first[D:], corridor.goal(corridor.plan(at(state_of(4), state_of(4)))))
    corridor.observe(first, 2, 0.0)  # which is noted without its goal
    second, _ = corridor.think(state_of(5))
    np.testing.assert_array_equal(second[D:], corridor.goal(corridor.plan(at(state_of(5), state_of(4)))))
    corridor.begin_episode()
    depth = CONFIG.short_term.depth
    assert first[D : D + depth * N_ACTIONS].reshape(depth, N_ACTIONS).tolist() == [[0, 0, 1]] * depth


@pytest.mark.parametrize("parts", [("actions",), ("reward", "state")])
def test_the_goal_has_the_size_announced(parts):
    config = dataclasses.replace(CONFIG, goal=GoalConfig(parts=parts), short_term=ShortTermConfig(depth=2))
    reasoner = new(config)
    reasoner.learn(random_trajectory(0))
    assert reasoner.goal(reasoner.plan(at(state_of(1), state_of(2)))).shape == (reasoner.goal_size,)
    assert reasoner.goal_size == sum({"actions": 2 * N_ACTIONS, "state": D, "reward": 1}[part] for part in parts)


def test_what_it_measures_are_columns_of_the_metrics():
    reasoner = new(THESIS)
    told = reasoner.learn(random_trajectory(0))
    assert set(told) <= set(COLUMNS)
    assert {name for name in COLUMNS if name.startswith(("map_", "seconds_"))} == set(told)
    graph = reasoner.state_map.graph_
    assert (told["map_nodes"], told["map_edges"]) == (len(graph), len(graph.edge_ids))
    assert all(value >= 0 for value in told.values()) and told["map_nodes"] > 1


def test_an_episode_noted_decision_by_decision_is_learned_like_one_given_whole():
    noted, given = new(), new()
    for seed in (0, 1):
        episode = random_trajectory(seed)
        for state, action, reward in zip(episode.states[:-1], episode.actions, episode.rewards, strict=True):
            noted.observe(np.append(state, 7 * np.ones(noted.goal_size)), int(action), float(reward))
        noted.end_episode(np.append(episode.states[-1], np.zeros(noted.goal_size, np.float32)))
        given.learn(episode)
    assert digest(noted.to_arrays()) == digest(given.to_arrays())


def test_without_rehearsal_each_episode_is_seen_as_the_thesis_has_it():
    reasoner, by_hand = new(THESIS, seed=4), NextStateNetwork(THESIS.models.next_state, D, N_ACTIONS, seed=4)
    for seed in (0, 1):
        reasoner.learn(random_trajectory(seed))
        for _ in range(3):
            by_hand.partial_fit(random_trajectory(seed).transitions)
    assert digest(reasoner.world.next_state.to_arrays()) == digest(by_hand.to_arrays())
    assert len(reasoner.world.experience) == 0


def test_rehearsal_keeps_what_was_learned_long_ago():
    """First the one half of the world, then for long the other, where the same actions do the opposite."""
    errors = {}
    for states in (0, 5000):
        models = dataclasses.replace(CONFIG.models, rehearsal_states=states)
        reasoner = new(dataclasses.replace(CONFIG, models=models))
        for i in range(9):
            rng = np.random.default_rng(i)
            side, actions = (-1 if i < 3 else 1), rng.integers(N_ACTIONS, size=60)
            moves = np.concatenate([[0], side * (actions - 1)])
            trajectory = np.column_stack([side * 20 + np.cumsum(moves), np.full(61, side)]).astype(np.float32)
            episode = Trajectory(states=trajectory, actions=actions, rewards=np.zeros(60, np.float32))
            reasoner.learn(episode)
            if i == 2:
                early = episode.transitions
        predicted = reasoner.world.next_state.predict(early.states, early.previous, early.actions)
        errors[states] = np.abs(predicted - early.next_states).mean()
        assert len(reasoner.world.experience) == (9 * 60 if states else 0)
    assert errors[5000] < 0.5 * errors[0]


def test_velocity_doubles_the_dimension_of_the_map():
    weight = 3.0
    reasoner = new(dataclasses.replace(THESIS, velocity_weight=weight))
    episode = random_trajectory(0, decisions=30)
    reasoner.learn(episode)
    graph = reasoner.state_map.graph_
    assert graph.node_means.shape[1] == 2 * D and graph.node_counts.sum() == 31 and graph.edge_counts.sum() == 30
    velocity = np.concatenate([np.zeros((1, D)), np.diff(episode.states, axis=0)])  # at the start there is none
    means = np.concatenate([episode.states, weight * velocity], axis=1).mean(axis=0)
    np.testing.assert_allclose(np.average(graph.node_means, axis=0, weights=graph.node_counts), means, atol=1e-4)
    plain = new(THESIS)
    plain.learn(episode)
    assert plain.state_map.graph_.node_means.shape[1] == D


@pytest.mark.parametrize("depth", [1, 2])
def test_with_velocity_both_ends_of_a_scenario_are_placed_by_where_they_came_from(depth):
    config = dataclasses.replace(
        CONFIG, velocity_weight=2.0, short_term=ShortTermConfig(depth=depth),
        state_map=StateMapConfig(node_threshold=1e-6, edge_threshold=1e-6),
    )  # fmt: skip
    actions = np.random.default_rng(0).integers(N_ACTIONS, size=60)
    places = np.column_stack([np.cumsum([0, *(3 * (actions - 1))]), np.arange(61) / 10]).astype(np.float32)
    reasoner = new(config)
    reasoner.learn(Trajectory(states=places, actions=actions, rewards=np.zeros(60, np.float32)))
    state = places[[20, 19]]
    plan = reasoner.plan(Moment(states=state))
    states = plan.scenarios.states

    def located(now, before):
        return reasoner.state_map.locate(np.concatenate([now, 2 * (now - before)], axis=1))

    means = reasoner.state_map.graph_.node_means
    assert plan.node == located(state[:1], state[1:])[0]
    np.testing.assert_allclose(means[plan.node], [*state[0], *2 * (state[0] - state[1])], atol=1e-5)
    before_last = states[:, -2] if depth > 1 else np.repeat(state[:1], len(states), axis=0)
    np.testing.assert_array_equal(plan.end_nodes, located(states[:, -1], before_last))
    assert len(set(plan.end_nodes.tolist())) > 1


FAST = dataclasses.replace(
    CONFIG,
    models=dataclasses.replace(CONFIG.models, rehearsal_states=100, rehearsal_reward_share=0.5),
    velocity_weight=1.0,
)


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
@pytest.mark.parametrize("until", [0, 13, 40, 47, 80])
def test_saved_midway_it_goes_on_bit_for_bit(config, until):
    """Before anything, within the first episode, between two, within the second and between two again."""

    def live(reasoner, begin, end):
        for i in range(begin, end):
            episode, t = random_trajectory(i // 40, decisions=40), i % 40
            seen, _ = reasoner.think(episode.states[t])
            reasoner.observe(seen, int(episode.actions[t]), float(episode.rewards[t]))
            if episode.rewards[t]:
                reasoner.revise(episode.states[t + 1])
            if t == 39:
                reasoner.end_episode(episode.states[-1])

    unbroken, restored = new(config), new(config)
    live(unbroken, 0, until)
    live(restored, 0, 55)  # used before
    restored.from_arrays(copied(unbroken))
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    for reasoner in (unbroken, restored):
        live(reasoner, until, 120)
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    state = random_trajectory(3).states[0]
    np.testing.assert_array_equal(restored.think(state)[0], unbroken.think(state)[0])
    np.testing.assert_array_equal(restored.routes.distances, unbroken.routes.distances)


def test_map_and_models_are_enough_to_plan(corridor):
    names = ("state_map/", "world/next_state/", "world/reward/")
    reasoner = new(seed=9)
    reasoner.load({name: value for name, value in copied(corridor).items() if name.startswith(names)})
    for cell in range(CELLS):
        one, two = (one_of.plan(at(state_of(cell))) for one_of in (corridor, reasoner))
        np.testing.assert_array_equal(one.scenarios.actions, two.scenarios.actions)
        np.testing.assert_array_equal(one.path, two.path)


def test_routes_are_those_of_the_map_and_its_costs():
    for config in (CONFIG, dataclasses.replace(CONFIG, long_term=LongTermConfig(cutoff=2))):
        reasoner, rng = new(config), np.random.default_rng(1)
        for start in (8, 0):
            play(reasoner, rng, start)
        expected = plan_routes(reasoner.state_map.graph_, config.long_term)
        np.testing.assert_array_equal(reasoner.routes.distances, expected.distances)
        np.testing.assert_array_equal(reasoner.routes.next_nodes, expected.next_nodes)
    assert np.isinf(reasoner.routes.distances).any() and np.isfinite(reasoner.routes.distances).any()


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
def test_the_same_seed_learns_the_same(config):
    digests = []
    for seed in (0, 0, 1):
        torch.rand(1)
        reasoner = new(config, seed)
        for i in range(2):
            reasoner.learn(random_trajectory(i))
        digests.append(digest(reasoner.to_arrays()))
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
def test_a_state_that_is_not_finite_is_refused_and_nothing_is_learned(config):
    reasoner, bad = new(config), random_trajectory(1)
    reasoner.learn(random_trajectory(0))
    before = digest(reasoner.to_arrays())
    bad.states[30, 1] = np.nan
    with pytest.raises(DataError):
        reasoner.learn(bad)
    assert digest(reasoner.to_arrays()) == before


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
def test_an_episode_of_one_decision_is_learned(config):
    reasoner = new(config)
    reasoner.learn(random_trajectory(0, decisions=1))
    reasoner.learn(random_trajectory(1, decisions=1))
    assert reasoner.state_map.graph_.edge_counts.sum() == 2
    assert np.isfinite(reasoner.think(random_trajectory(0).states[0])[0]).all()


@pytest.mark.parametrize(
    "values",
    [
        {"planner_every": -1},
        {"velocity_weight": -0.1},
        {"velocity_weight": np.inf},
        {"discount": 0.0},
        {"discount": 1.1},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        ReasoningConfig(**values)


def test_too_many_scenarios_are_refused_at_once():
    with pytest.raises(UsageError, match=r"short_term\.depth"):
        Reasoner(dataclasses.replace(CONFIG, short_term=ShortTermConfig(depth=8)), D, N_ACTIONS, seed=0)


def test_the_planner_leads_as_often_as_it_is_told():
    for every, led in ((0, []), (1, [0, 1, 2, 3, 4, 5]), (2, [1, 3, 5]), (3, [2, 5])):
        reasoner = new(dataclasses.replace(CONFIG, planner_every=every))
        assert [episode for episode in range(6) if reasoner.leads(episode)] == led


def test_trees_solve_the_corridor_by_plans_alone():
    reasoner, rng = new(TREES), np.random.default_rng(0)
    for _ in range(20):
        play(reasoner, rng, int(rng.integers(CELLS - 1)))
    for start in range(CELLS - 1):
        reasoner.begin_episode()
        cell, reward = start, 0.0
        for _ in range(12):
            if not reward:
                seen, _ = reasoner.think(state_of(cell))
                action = reasoner.proposed_action
                cell, reward = step(cell, action)
                reasoner.observe(seen, action, reward)
        assert reward == 1, start


def test_trees_cannot_look_back_farther_than_is_remembered():
    for name in ("past_states", "past_actions"):
        with pytest.raises(UsageError, match="may be 16 at most"):
            dataclasses.replace(TREES, trees=dataclasses.replace(TREES.trees, **{name: 17}))


def test_the_curious_seek_what_others_avoid():
    """Of two scenarios that promise the same, the forests disagree about one."""
    reasoner = new(dataclasses.replace(TREES, caution=1.0, curiosity=2.0))
    reasoner.learn(random_trajectory(0))
    imagined = reasoner.world.imagine

    def doubtful(moment, sequences):
        told = imagined(moment, sequences)
        doubts = (np.arange(len(told)) == 1).astype(np.float32)
        return dataclasses.replace(told, rewards=0 * told.rewards, values=0 * told.values, doubts=doubts)

    reasoner.world.imagine = doubtful
    moment = Moment(states=np.zeros((1, D), np.float32), actions=np.zeros(0, np.int64), number=0)
    for curious, returns in ((False, (0, -1)), (True, (1, 0))):
        plan = reasoner.plan(moment, curious=curious)
        assert (plan.returns[0], plan.returns[-1]) == returns
