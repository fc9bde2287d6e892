"""The lower line as a whole: a small world is played at random, learned, and then solved by plans alone."""

import dataclasses

import numpy as np
import pytest
import torch

from semrl.core import History, Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.grounding import PlanFeaturesConfig
from semrl.planning import LongTermConfig, plan_routes
from semrl.planning.config import PlanningConfig
from semrl.planning.judged import JudgedPlanner
from semrl.planning.keeping import KeepingConfig
from semrl.planning.module import PlanningModule
from semrl.planning.scenario_planner import ScenarioPlannerConfig
from semrl.planning.state_map import StateMapConfig
from semrl.training.config import MODELS
from semrl.world_model import ModelPairConfig, NextStateConfig, NextStateNetwork, RewardConfig, TreesConfig

CELLS, N_ACTIONS, D = 10, 3, 2
CONFIG = PlanningConfig(
    state_map=StateMapConfig(node_threshold=0.05, edge_threshold=0.05, reward_weight=10),
    networks=ModelPairConfig(
        next_state=NextStateConfig(
            hidden_units=(32,), learning_rate=3e-3, batch_size=16, epochs=15, predict_change=True
        ),
        reward=RewardConfig(kind="network", hidden_units=(32,), learning_rate=1e-2, batch_size=16, epochs=15),
        rehearsal_states=5000,
    ),
    scenarios=ScenarioPlannerConfig(depth=3),
    discount=0.9,
)
THESIS = PlanningConfig(
    networks=ModelPairConfig(next_state=NextStateConfig(hidden_units=(16,), epochs=3)),
    scenarios=ScenarioPlannerConfig(depth=2),
)
TREES = dataclasses.replace(
    CONFIG, world_model="trees", trees=TreesConfig(members=2, resolution=0.5, first_decisions=30, new_decisions=10),
    scenarios=ScenarioPlannerConfig(depth=6, scenarios=16), planner_every=2,
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


def plan_at(module, cell):
    """Plan where the corridor is; return the facts."""
    module.plan_step(state_of(cell))
    return state_of(cell)


def play(module, rng, start, decisions=80):
    """An episode at random, as the trainer plays it; return what `end_episode` tells."""
    cell = start
    seen = plan_at(module, cell)
    for _ in range(decisions):
        action = int(rng.integers(N_ACTIONS))
        cell, reward = step(cell, action)
        module.observe(seen, action, reward)
        seen = plan_at(module, cell)
        if reward:
            break
    return module.end_episode(seen)


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
    return History(states=np.stack(states))


def new(config=CONFIG, seed=0):
    return PlanningModule(config, D, N_ACTIONS, seed=seed)


def copied(module):
    return {name: array.copy() for name, array in module.to_arrays().items()}


@pytest.fixture(scope="module")
def corridor():
    """A module that has seen twenty random episodes of the corridor. Read only."""
    module, rng = new(), np.random.default_rng(0)
    for _ in range(20):
        play(module, rng, int(rng.integers(CELLS - 1)))
    return module


def test_the_models_that_reason():
    assert {name for name, model in MODELS.items() if model.plans} == {"semantic-map", "ram-map", "objects-map"}


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
    history = at(state_of(3), state_of(4))
    first, again = (corridor.plan(history) for _ in range(2))
    np.testing.assert_array_equal(first.scenarios.actions, again.scenarios.actions)
    np.testing.assert_array_equal(first.returns, again.returns)
    assert digest(corridor.to_arrays()) == before
    assert history.states.tolist() == [state_of(3).tolist(), state_of(4).tolist()]


def test_before_anything_was_learned_there_is_no_plan_and_its_features_are_zero():
    module = new()
    history = at(state_of(3), state_of(4))
    assert module.plan(history) is None and module.proposed_action is None
    record = module.plan_step(state_of(3))
    assert record.plan is None and module.proposed_action is None
    assert record.features.dtype == np.float32 and record.features.shape == (module.plan_size,)
    assert not record.features.any()
    module.learn(random_trajectory(0))
    assert module.plan_step(state_of(3)).features.any() and module.plan(history)


def test_what_the_agent_is_shown_are_the_features_of_the_plan(corridor):
    corridor.begin_episode()
    first = corridor.plan_step(state_of(4))
    assert first.history.states.tolist() == [state_of(4).tolist()]
    assert corridor.proposed_action == first.plan.actions[0] and first.features.dtype == np.float32
    np.testing.assert_array_equal(first.features, corridor.grounder.ground(corridor.plan(at(state_of(4)))))
    corridor.observe(state_of(4), 2, 0.0)
    second = corridor.plan_step(state_of(5))
    assert second.history.states.tolist() == [state_of(5).tolist(), state_of(4).tolist()]
    assert second.history.actions.tolist() == [2]
    expected = corridor.plan(at(state_of(5), state_of(4)))
    np.testing.assert_array_equal(second.features, corridor.grounder.ground(expected))
    corridor.begin_episode()
    depth = CONFIG.scenarios.depth
    assert first.features[: depth * N_ACTIONS].reshape(depth, N_ACTIONS).tolist() == [[0, 0, 1]] * depth


def test_an_episode_begins_without_what_was_done_or_proposed_before(corridor):
    corridor.begin_episode()
    corridor.plan_step(state_of(4))
    corridor.observe(state_of(4), 0, 0.0)
    corridor.begin_episode()
    assert corridor.proposed_action is None
    record = corridor.plan_step(state_of(2))
    assert record.history.states.tolist() == [state_of(2).tolist()] and not len(record.history.actions)
    corridor.begin_episode()


@pytest.mark.parametrize("first", range(N_ACTIONS))
def test_a_plan_may_be_asked_for_with_a_given_first_action(corridor, first):
    free, bound = (corridor.plan(at(state_of(4)), first=action) for action in (None, first))
    assert (bound.scenarios.actions[:, 0] == first).all() and len(bound.actions) == len(free.actions)
    begins = free.scenarios.actions[:, 0] == first
    assert bound.returns[0] == free.returns[begins].max()


@pytest.mark.parametrize("parts", [("actions",), ("reward", "state")])
def test_the_features_have_the_size_announced(parts):
    config = dataclasses.replace(
        CONFIG, plan_features=PlanFeaturesConfig(parts=parts), scenarios=ScenarioPlannerConfig(depth=2)
    )
    module = new(config)
    module.learn(random_trajectory(0))
    assert module.plan_step(state_of(1)).features.shape == (module.plan_size,)
    assert module.plan_size == sum({"actions": 2 * N_ACTIONS, "state": D, "reward": 1}[part] for part in parts)


def test_what_it_measures_are_columns_of_the_metrics():
    module = new(THESIS)
    told = module.learn(random_trajectory(0))
    assert list(told) == [
        "map_nodes", "map_edges", "seconds_map", "seconds_next_state", "seconds_reward", "seconds_routes",
    ]  # fmt: skip
    graph = module.state_map.graph_
    assert (told["map_nodes"], told["map_edges"]) == (len(graph), len(graph.edge_ids))
    assert all(value >= 0 for value in told.values()) and told["map_nodes"] > 1


def test_an_episode_noted_decision_by_decision_is_learned_like_one_given_whole():
    noted, given = new(), new()
    for seed in (0, 1):
        episode = random_trajectory(seed)
        for state, action, reward in zip(episode.states[:-1], episode.actions, episode.rewards, strict=True):
            noted.plan_step(state)
            noted.observe(state, int(action), float(reward))
        noted.plan_step(episode.states[-1])
        noted.end_episode(episode.states[-1])
        given.learn(episode)
    assert digest(noted.to_arrays()) == digest(given.to_arrays())


def test_without_rehearsal_each_episode_is_seen_as_the_thesis_has_it():
    module, by_hand = new(THESIS, seed=4), NextStateNetwork(THESIS.networks.next_state, D, N_ACTIONS, seed=4)
    for seed in (0, 1):
        module.learn(random_trajectory(seed))
        for _ in range(3):
            by_hand.partial_fit(random_trajectory(seed).transitions)
    assert digest(module.world_model.next_state.to_arrays()) == digest(by_hand.to_arrays())
    assert len(module.world_model.experience) == 0


def test_rehearsal_keeps_what_was_learned_long_ago():
    """First the one half of the world, then for long the other, where the same actions do the opposite."""
    errors = {}
    for states in (0, 5000):
        networks = dataclasses.replace(CONFIG.networks, rehearsal_states=states)
        module = new(dataclasses.replace(CONFIG, networks=networks))
        for i in range(9):
            rng = np.random.default_rng(i)
            side, actions = (-1 if i < 3 else 1), rng.integers(N_ACTIONS, size=60)
            moves = np.concatenate([[0], side * (actions - 1)])
            trajectory = np.column_stack([side * 20 + np.cumsum(moves), np.full(61, side)]).astype(np.float32)
            episode = Trajectory(states=trajectory, actions=actions, rewards=np.zeros(60, np.float32))
            module.learn(episode)
            if i == 2:
                early = episode.transitions
        predicted = module.world_model.next_state.predict(early.states, early.previous, early.actions)
        errors[states] = np.abs(predicted - early.next_states).mean()
        assert len(module.world_model.experience) == (9 * 60 if states else 0)
    assert errors[5000] < 0.5 * errors[0]


def test_velocity_doubles_the_dimension_of_the_map():
    weight = 3.0
    module = new(dataclasses.replace(THESIS, velocity_weight=weight))
    episode = random_trajectory(0, decisions=30)
    module.learn(episode)
    graph = module.state_map.graph_
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
        CONFIG, velocity_weight=2.0, scenarios=ScenarioPlannerConfig(depth=depth),
        state_map=StateMapConfig(node_threshold=1e-6, edge_threshold=1e-6),
    )  # fmt: skip
    actions = np.random.default_rng(0).integers(N_ACTIONS, size=60)
    places = np.column_stack([np.cumsum([0, *(3 * (actions - 1))]), np.arange(61) / 10]).astype(np.float32)
    module = new(config)
    module.learn(Trajectory(states=places, actions=actions, rewards=np.zeros(60, np.float32)))
    state = places[[20, 19]]
    plan = module.plan(History(states=state))
    states = plan.scenarios.states

    def located(now, before):
        return module.state_map.locate(np.concatenate([now, 2 * (now - before)], axis=1))

    means = module.state_map.graph_.node_means
    assert plan.node == located(state[:1], state[1:])[0]
    np.testing.assert_allclose(means[plan.node], [*state[0], *2 * (state[0] - state[1])], atol=1e-5)
    before_last = states[:, -2] if depth > 1 else np.repeat(state[:1], len(states), axis=0)
    np.testing.assert_array_equal(plan.end_nodes, located(states[:, -1], before_last))
    assert len(set(plan.end_nodes.tolist())) > 1


FAST = dataclasses.replace(
    CONFIG,
    networks=dataclasses.replace(CONFIG.networks, rehearsal_states=100, rehearsal_reward_share=0.5),
    velocity_weight=1.0,
)


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
@pytest.mark.parametrize("until", [0, 13, 40, 47, 80])
def test_saved_midway_it_goes_on_bit_for_bit(config, until):
    """Before anything, within the first episode, between two, within the second and between two again."""

    def live(module, begin, end):
        for i in range(begin, end):
            episode, t = random_trajectory(i // 40, decisions=40), i % 40
            module.plan_step(episode.states[t])
            module.observe(episode.states[t], int(episode.actions[t]), float(episode.rewards[t]))
            if episode.rewards[t]:
                module.update_online(episode.states[t + 1])
            if t == 39:
                module.end_episode(episode.states[-1])

    unbroken, restored = new(config), new(config)
    live(unbroken, 0, until)
    live(restored, 0, 55)  # used before
    restored.from_arrays(copied(unbroken))
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    for module in (unbroken, restored):
        live(module, until, 120)
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    state = random_trajectory(3).states[0]
    np.testing.assert_array_equal(restored.plan_step(state).features, unbroken.plan_step(state).features)
    np.testing.assert_array_equal(restored.routes.distances, unbroken.routes.distances)


def test_map_and_models_are_enough_to_plan(corridor):
    module, enough = new(seed=9), corridor.inference_arrays()
    module.from_arrays({name: value.copy() for name, value in enough.items()})
    assert set(enough) < set(corridor.to_arrays()) and not any("experience" in name for name in enough)
    for cell in range(CELLS):
        one, two = (one_of.plan(at(state_of(cell))) for one_of in (corridor, module))
        np.testing.assert_array_equal(one.scenarios.actions, two.scenarios.actions)
        np.testing.assert_array_equal(one.path, two.path)


def test_routes_are_those_of_the_map_and_its_costs():
    for config in (CONFIG, dataclasses.replace(CONFIG, long_term=LongTermConfig(cutoff=2))):
        module, rng = new(config), np.random.default_rng(1)
        for start in (8, 0):
            play(module, rng, start)
        expected = plan_routes(module.state_map.graph_, config.long_term)
        np.testing.assert_array_equal(module.routes.distances, expected.distances)
        np.testing.assert_array_equal(module.routes.next_nodes, expected.next_nodes)
    assert np.isinf(module.routes.distances).any() and np.isfinite(module.routes.distances).any()


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
def test_the_same_seed_learns_the_same(config):
    digests = []
    for seed in (0, 0, 1):
        torch.rand(1)
        module = new(config, seed)
        for i in range(2):
            module.learn(random_trajectory(i))
        digests.append(digest(module.to_arrays()))
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
def test_a_state_that_is_not_finite_is_refused_and_nothing_is_learned(config):
    module, bad = new(config), random_trajectory(1)
    module.learn(random_trajectory(0))
    before = digest(module.to_arrays())
    bad.states[30, 1] = np.nan
    with pytest.raises(DataError):
        module.learn(bad)
    assert digest(module.to_arrays()) == before


@pytest.mark.parametrize("config", [THESIS, FAST, TREES], ids=["thesis", "rehearsal", "trees"])
def test_an_episode_of_one_decision_is_learned(config):
    module = new(config)
    module.learn(random_trajectory(0, decisions=1))
    module.learn(random_trajectory(1, decisions=1))
    assert module.state_map.graph_.edge_counts.sum() == 2
    assert np.isfinite(module.plan_step(random_trajectory(0).states[0]).features).all()


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
        PlanningConfig(**values)


def test_too_many_scenarios_are_refused_at_once():
    with pytest.raises(UsageError, match=r"scenarios\.depth"):
        PlanningModule(dataclasses.replace(CONFIG, scenarios=ScenarioPlannerConfig(depth=8)), D, N_ACTIONS, seed=0)


def test_the_planner_leads_as_often_as_it_is_told():
    for every, led in ((0, []), (1, [0, 1, 2, 3, 4, 5]), (2, [1, 3, 5]), (3, [2, 5])):
        module = new(dataclasses.replace(CONFIG, planner_every=every))
        assert [episode for episode in range(6) if module.planner_controls(episode)] == led


def test_trees_solve_the_corridor_by_plans_alone():
    module, rng = new(TREES), np.random.default_rng(0)
    for _ in range(20):
        play(module, rng, int(rng.integers(CELLS - 1)))
    for start in range(CELLS - 1):
        module.begin_episode()
        cell, reward = start, 0.0
        for _ in range(12):
            if not reward:
                seen = plan_at(module, cell)
                action = module.proposed_action
                cell, reward = step(cell, action)
                module.observe(seen, action, reward)
        assert reward == 1, start


def test_trees_cannot_look_back_farther_than_is_remembered():
    for name in ("past_states", "past_actions"):
        with pytest.raises(UsageError, match="may be 16 at most"):
            dataclasses.replace(TREES, trees=dataclasses.replace(TREES.trees, **{name: 17}))


def test_who_explores_seeks_what_others_avoid():
    """Of two scenarios that promise the same, the forests disagree about one."""
    module = new(
        dataclasses.replace(
            TREES, scenarios=dataclasses.replace(TREES.scenarios, uncertainty_penalty=1.0, exploration_bonus=2.0)
        )
    )
    module.learn(random_trajectory(0))
    imagined = module.world_model.imagine

    def doubtful(history, sequences):
        told = imagined(history, sequences)
        uncertainties = (np.arange(len(told)) == 1).astype(np.float32)
        return dataclasses.replace(told, rewards=0 * told.rewards, values=0 * told.values, uncertainties=uncertainties)

    module.world_model.imagine = doubtful
    history = History(states=np.zeros((1, D), np.float32), actions=np.zeros(0, np.int64), number=0)
    for exploring, returns in ((False, (0, -1)), (True, (1, 0))):
        plan = module.plan(history, exploring=exploring)
        assert (plan.returns[0], plan.returns[-1]) == returns


class Asked(JudgedPlanner[None]):
    """Plans as another planner does, and counts how often."""

    def plan(self, *args, **kwargs):
        self.times = getattr(self, "times", 0) + 1
        return self.planner.plan(*args, **kwargs)


@pytest.mark.parametrize("judged", [False, True])
def test_plans_are_kept_unless_they_are_judged(judged, monkeypatch):
    module, rng = (
        new(dataclasses.replace(TREES, keeping=KeepingConfig(decisions=3, tolerance=0.1))),
        np.random.default_rng(0),
    )
    for _ in range(8):
        play(module, rng, int(rng.integers(CELLS - 1)))
    asked = Asked(module.planner, None)
    if judged:
        module.planner = asked
    else:
        monkeypatch.setattr(module, "plan", lambda history, **options: asked.plan(history, module.knowledge, **options))
    module.begin_episode()
    cell = 2
    for _ in range(4):
        action = int(module.plan_step(state_of(cell)).plan.actions[0])
        module.observe(state_of(cell), action, 0.0)
        cell, _ = step(cell, action)
    assert (asked.times == 4) == judged
