"""What must be true of a state map, and the true graph of a world small enough to know it."""

from itertools import pairwise

import numpy as np
import pytest

from semrl.core import MapGraph, Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering import CFTree
from semrl.planning.state_map import StateMap, StateMapConfig

D, N_ACTIONS = 6, 3
COARSE = StateMapConfig(node_threshold=0.1, edge_threshold=0.1, branching_factor=8)  # 0.6 in six dimensions
CAPPED = StateMapConfig(node_threshold=0.02, edge_threshold=0.02, branching_factor=8, max_nodes=30, max_edges=50)
MOVES = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])


def a_map(config=COARSE):
    return StateMap(config, D, N_ACTIONS, changes=True)


def episode(seed=0, decisions=120, scale=0.3):
    """A walk through space with an occasional gain or loss."""
    rng = np.random.default_rng(seed)
    steps = scale * rng.normal(size=(decisions + 1, D))
    return Trajectory(
        states=np.cumsum(steps, axis=0).astype(np.float32),
        actions=rng.integers(N_ACTIONS, size=decisions),
        rewards=rng.choice([-1, 0, 0, 0, 1], size=decisions).astype(np.float32),
    )


def part(whole, start, stop):
    """The decisions from `start` up to `stop`."""
    return Trajectory(
        states=whole.states[start : stop + 1], actions=whole.actions[start:stop], rewards=whole.rewards[start:stop]
    )


def rows_of(trajectory, weight=1.0):
    one_hot = np.eye(N_ACTIONS)[trajectory.actions]
    return np.column_stack([trajectory.states[:-1], trajectory.states[1:], one_hot, trajectory.rewards * weight])


def arrays_of(graph):
    return {name: getattr(graph, name) for name in MapGraph.__dataclass_fields__}


def grid_step(cell, action, size):
    return np.clip(cell + MOVES[action], 0, size - 1)


def grid_walk(seed, decisions, size):
    """A random walk over a board with walls around it; the last corner pays, the one before costs."""
    rng = np.random.default_rng(seed)
    actions = rng.integers(4, size=decisions)
    cells = [np.zeros(2, np.int64)]
    for action in actions:
        cells.append(grid_step(cells[-1], action, size))
    states = np.array(cells, np.float32)
    rewards = np.select([(states[1:] == size - 1).all(1), (states[1:] == [size - 1, 0]).all(1)], [1, -1], 0)
    return Trajectory(states=states, actions=actions, rewards=rewards.astype(np.float32))


@pytest.mark.parametrize("config", [COARSE, CAPPED], ids=["coarse", "capped"])
def test_every_state_and_transition_is_counted_once(config):
    learned, decisions = a_map(config), 0
    for seed in range(4):
        learned.partial_fit(episode(seed))
        decisions += 120
        graph = learned.graph_
        assert graph.node_counts.sum() == decisions + seed + 1  # an episode has one state more than decisions
        assert graph.edge_counts.sum() == decisions
        assert (np.diff(graph.node_ids) > 0).all() and (np.diff(graph.edge_ids) > 0).all()
        assert ((graph.sources >= 0) & (graph.sources < len(graph))).all()
        assert ((graph.targets >= 0) & (graph.targets < len(graph))).all()
        np.testing.assert_allclose(graph.actions.sum(1), 1, atol=1e-12)
        assert (graph.actions >= 0).all() and (np.abs(graph.rewards) <= 1 + 1e-12).all()


@pytest.mark.parametrize("config", [COARSE, CAPPED], ids=["coarse", "capped"])
def test_an_edge_tells_the_means_of_its_transitions(config):
    learned, tree, rows = a_map(config), CFTree(config.edges(D)), []
    given = np.zeros(0, np.int64)
    for seed in range(3):
        learned.partial_fit(episode(seed))
        rows.append(rows_of(episode(seed)))
        given = np.concatenate([given, tree.insert(rows[-1])])
    rows, owners, graph = np.concatenate(rows), tree.resolve(given), learned.graph_
    np.testing.assert_array_equal(np.unique(owners), graph.edge_ids)
    for place, edge in enumerate(graph.edge_ids):
        mine = rows[owners == edge]
        assert graph.edge_counts[place] == len(mine)
        np.testing.assert_allclose(graph.rewards[place], mine[:, -1].mean(), atol=1e-9)
        np.testing.assert_allclose(graph.actions[place], mine[:, 2 * D : -1].mean(0), atol=1e-9)
        ends = np.stack([mine[:, :D].mean(0), mine[:, D : 2 * D].mean(0)])
        np.testing.assert_array_equal(learned.locate(ends), [graph.sources[place], graph.targets[place]])


def test_a_small_world_has_its_true_graph():
    size, tiny = 5, StateMapConfig(node_threshold=1e-3, edge_threshold=1e-3)
    learned = StateMap(tiny, 2, 4, changes=True)
    for seed in range(6):
        learned.partial_fit(grid_walk(seed, 400, size))
    graph = learned.graph_
    cells = {tuple(cell) for cell in graph.node_means}
    assert cells == {(i, j) for i in range(size) for j in range(size)} and len(graph) == size**2
    edges = {
        (tuple(graph.node_means[source]), int(shares.argmax()), tuple(graph.node_means[target])): reward
        for source, target, shares, reward in zip(
            graph.sources, graph.targets, graph.actions, graph.rewards, strict=True
        )
    }
    true = {}
    for cell in cells:
        for action in range(4):
            end = tuple(grid_step(np.array(cell), action, size))
            reward = {(size - 1, size - 1): 1.0, (size - 1, 0): -1.0}.get(end, 0.0)
            true[cell, action, end] = reward
    assert edges == true
    assert len(graph.edge_ids) == 4 * size**2
    np.testing.assert_array_equal(graph.actions.max(1), 1)


def test_nodes_and_edges_keep_their_ids():
    learned = a_map()
    for seed in range(4):
        before = learned.graph_
        learned.partial_fit(episode(seed))
        after = learned.graph_
        for old, new in ((before.node_ids, after.node_ids), (before.edge_ids, after.edge_ids)):
            assert np.isin(old, new).all()
            assert (np.setdiff1d(new, old) > old.max(initial=-1)).all()
        here = np.searchsorted(after.node_ids, before.node_ids)
        assert (after.node_counts[here] >= before.node_counts).all()


def test_limits_are_kept_and_the_older_id_lives_on():
    learned, older = a_map(CAPPED), np.zeros(0, np.int64)
    for seed in range(6):
        learned.partial_fit(episode(seed))
        graph = learned.graph_
        assert len(graph) <= 30 and len(graph.edge_ids) <= 50
        assert not np.isin(np.setdiff1d(np.arange(older.max(initial=-1) + 1), older), graph.node_ids).any()
        older = graph.node_ids
    assert len(graph) > 10 and len(graph.edge_ids) > 15


def test_a_heavy_reward_keeps_gains_losses_and_neutral_transitions_apart():
    heavy, light = (StateMapConfig(node_threshold=5, edge_threshold=5, reward_weight=w) for w in (1000.0, 1.0))
    mixed = a_map(light).partial_fit(episode()).graph_
    apart = a_map(heavy).partial_fit(episode()).graph_
    assert (np.abs(mixed.rewards) < 1).any()
    np.testing.assert_allclose(apart.rewards, apart.reward_signs, atol=1e-9)
    for sign in (-1, 0, 1):
        assert apart.edge_counts[apart.reward_signs == sign].sum() == (episode().rewards == sign).sum()


def test_compact_reaches_both_trees():
    config = StateMapConfig(compact=True)
    assert config.nodes(D).compact and config.edges(D).compact


def test_thresholds_are_those_of_the_thesis_times_the_dimension():
    config = StateMapConfig()
    assert config.nodes(64).threshold == pytest.approx(0.704)
    assert config.edges(64).threshold == pytest.approx(0.96)
    assert config.nodes(64).max_leaves is None and config.edges(64).branching_factor == 100


def test_an_episode_may_be_cut_anywhere():
    whole, parts = a_map().partial_fit(episode()), a_map()
    ends = [0, 1, 40, 41, 120]
    for start, stop in pairwise(ends):
        parts.partial_fit(part(episode(), start, stop))
    edges = {name: array for name, array in whole.to_arrays().items() if name.startswith("edges/")}
    assert digest(edges) == digest({name: parts.to_arrays()[name] for name in edges})
    assert parts.graph_.node_counts.sum() == whole.graph_.node_counts.sum() + 3  # states at the cuts count twice


@pytest.mark.parametrize("config", [COARSE, CAPPED], ids=["coarse", "capped"])
@pytest.mark.parametrize("stop", [0, 1, 3])
def test_a_restored_map_goes_on_bit_for_bit(config, stop):
    unbroken, restored = a_map(config), a_map(config)
    for seed in range(stop):
        unbroken.partial_fit(episode(seed))
    restored.from_arrays({name: array.copy() for name, array in unbroken.to_arrays().items()})
    for seed in range(stop, 5):
        assert digest(arrays_of(restored.graph_)) == digest(arrays_of(unbroken.graph_))
        unbroken.partial_fit(episode(seed))
        restored.partial_fit(episode(seed))
    assert digest(restored.to_arrays()) == digest(unbroken.to_arrays())
    assert digest(arrays_of(restored.graph_)) == digest(arrays_of(unbroken.graph_))
    states = episode(7).states
    np.testing.assert_array_equal(restored.locate(states), unbroken.locate(states))


def test_locating_learns_nothing_and_inputs_are_left_alone():
    learned, given = a_map(), episode()
    for array in (given.states, given.actions, given.rewards):
        array.flags.writeable = False
    before = digest(learned.partial_fit(given).to_arrays())
    places = learned.locate(given.states)
    assert places.dtype == np.int64 and places.shape == (121,)
    np.testing.assert_array_equal(places, [learned.locate(state[None])[0] for state in given.states])
    assert digest(learned.to_arrays()) == before
    assert learned.locate(given.states[:0]).shape == (0,)


def test_a_snapshot_stays_what_it_was():
    learned = a_map().partial_fit(episode())
    graph = learned.graph_
    assert learned.graph_ is graph
    before = digest(arrays_of(graph))
    learned.partial_fit(episode(1))
    assert digest(arrays_of(graph)) == before and learned.graph_ is not graph
    with pytest.raises(ValueError, match="read-only"):
        graph.node_ids[0] = 7


def test_an_empty_map_and_an_episode_without_decisions():
    learned = a_map()
    graph = learned.graph_
    assert len(graph) == 0 and len(graph.sources) == len(graph.targets) == len(graph.rewards) == 0
    assert graph.node_means.shape == (0, D) and graph.actions.shape == (0, N_ACTIONS)
    with pytest.raises(DataError, match="partial_fit first"):
        learned.locate(np.zeros((1, D), np.float32))
    learned.partial_fit(part(episode(), 0, 0))
    assert len(learned.graph_) == 1 and len(learned.graph_.sources) == 0
    np.testing.assert_array_equal(learned.locate(np.zeros((2, D))), [0, 0])
    learned.from_arrays(a_map().to_arrays())
    assert len(learned.graph_) == 0


def spoiled(**changes):
    given = episode(decisions=4)
    return Trajectory(**({name: getattr(given, name).copy() for name in ("states", "actions", "rewards")} | changes))


@pytest.mark.parametrize(
    "bad",
    [
        spoiled(states=np.zeros((5, D + 1), np.float32)),
        spoiled(states=np.zeros((4, D), np.float32)),
        spoiled(states=np.full((5, D), np.nan, np.float32)),
        spoiled(rewards=np.array([0, np.inf, 0, 0], np.float32)),
        spoiled(rewards=np.zeros(3, np.float32)),
        spoiled(actions=np.array([0, 1, N_ACTIONS, 0])),
        spoiled(actions=np.array([0, 1, -1, 0])),
        spoiled(actions=np.array([0.0, 1.0, 0.5, 0.0])),
        spoiled(states=np.full((1, D), np.inf), actions=np.zeros(0, np.int64), rewards=np.zeros(0, np.float32)),
    ],
)
def test_bad_episodes_are_refused_and_nothing_is_learned(bad):
    learned = a_map().partial_fit(episode())
    before, graph = digest(learned.to_arrays()), learned.graph_
    with pytest.raises(DataError) as error:
        learned.partial_fit(bad)
    assert "\n" not in str(error.value)
    assert digest(learned.to_arrays()) == before and learned.graph_ is graph


@pytest.mark.parametrize("states", [np.zeros((1, D + 1)), np.full((1, D), np.nan), np.zeros(D)])
def test_what_is_no_state_is_not_located(states):
    with pytest.raises(DataError):
        a_map().partial_fit(episode()).locate(states)


def test_arrays_of_another_map_are_refused():
    learned = a_map().partial_fit(episode())
    saved, before = learned.to_arrays(), digest(learned.to_arrays())
    nodeless = {n: a for n, a in saved.items() if n.startswith("edges/")}
    nodeless |= {n: a for n, a in a_map().to_arrays().items() if n.startswith("nodes/")}
    for arrays in ({}, nodeless, {n: a for n, a in saved.items() if n != "edges/children"}):
        with pytest.raises(DataError):
            learned.from_arrays(arrays)
    assert digest(learned.to_arrays()) == before
    for other in (StateMap(COARSE, D + 1, N_ACTIONS, changes=True), StateMap(COARSE, D, N_ACTIONS + 1, changes=True)):
        with pytest.raises(DataError, match="the saved map"):
            other.from_arrays(saved)


@pytest.mark.parametrize(
    "values",
    [
        {"node_threshold": -1},
        {"edge_threshold": np.nan},
        {"node_threshold": np.inf},
        {"branching_factor": 1},
        {"max_nodes": -1},
        {"max_edges": -1},
        {"reward_weight": 0.0},
        {"reward_weight": np.nan},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        StateMapConfig(**values)


def test_transitions_are_located_where_they_were_learned():
    learned = a_map().partial_fit(episode())
    places = learned.locate_transitions(episode())
    assert places.shape == (120,)
    graph = learned.graph_
    rows = np.concatenate([graph.rewards[:, None], graph.actions], axis=1)[places]  # means of the edges found
    assert np.abs(rows[:, 0] - episode().rewards).mean() < 0.3
    assert (rows[np.arange(120), 1 + episode().actions] > 0).mean() > 0.9
    assert digest(learned.to_arrays()) == digest(a_map().partial_fit(episode()).to_arrays())  # nothing was learned


def test_transitions_on_an_empty_map_are_told():
    with pytest.raises(DataError, match="the map has no edges"):
        a_map().locate_transitions(episode())


def test_thresholds_count_a_state_and_its_change():
    """Points on a line, 0.15 apart: the change that is not among a state's numbers counts all the same."""
    config = StateMapConfig(node_threshold=0.1, edge_threshold=0.1)
    line = Trajectory(
        states=(0.15 * np.arange(20, dtype=np.float32))[:, None],
        actions=np.zeros(19, np.int64),
        rewards=np.zeros(19, np.float32),
    )
    alone, with_change = (
        len(StateMap(config, 1, 1, changes=changes).partial_fit(line).graph_) for changes in (True, False)
    )
    assert with_change < alone
    assert StateMap(config, 1, 1).partial_fit(line).graph_.node_means.shape == (with_change, 1)
