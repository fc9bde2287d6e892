"""The order of scenarios (§3.4.4): reward, then progress along the path, then closeness to the node reached."""

import numpy as np
import pytest

from semrl.core import MapGraph, Scenarios
from semrl.planning import LongTermConfig, plan_routes, rank


class LineMap:
    """Nodes at whole numbers on a line, edges between neighbours to the right, a reward behind the last one."""

    def __init__(self, length=5, reward=1.0):
        ends = [(i, i + 1) for i in range(length - 1)] + [(length - 1, length - 1)] * bool(length)
        m = len(ends)
        rewards = np.zeros(m)
        rewards[-1:] = reward
        self.graph_ = MapGraph(
            node_ids=np.arange(length) * 2,
            node_means=np.arange(length, dtype=np.float64)[:, None],
            node_counts=np.ones(length, np.int64),
            edge_ids=np.arange(m),
            sources=np.array([a for a, _ in ends], np.int64),
            targets=np.array([b for _, b in ends], np.int64),
            edge_counts=np.ones(m, np.int64),
            rewards=rewards,
            actions=np.ones((m, 1)),
        )

    def locate(self, states):
        assert len(self.graph_), "an empty map knows no places"
        return np.abs(states[:, :1] - self.graph_.node_means.T).argmin(axis=1)


def ranked(
    ends, rewards=None, *, values=None, uncertainties=None, start=0.0, line=None, discount=1.0, uncertainty_penalty=0.0
):
    """Rank scenarios that end somewhere; each is known by its action, its number."""
    line = line or LineMap()
    ends = np.array(ends, np.float32)[:, None]
    rewards = np.zeros((len(ends), 1), np.int64) if rewards is None else np.array(rewards)
    scenarios = Scenarios(
        actions=np.repeat(np.arange(len(ends))[:, None], rewards.shape[1], axis=1),
        states=np.repeat(ends[:, None], rewards.shape[1], axis=1),
        rewards=rewards,
        values=np.zeros(len(ends)) if values is None else np.array(values),
        uncertainties=None if uncertainties is None else np.array(uncertainties),
    )
    routes = plan_routes(line.graph_, LongTermConfig())
    return rank(
        scenarios,
        np.array([[start]], np.float32),
        ends,
        line,
        routes,
        discount=discount,
        uncertainty_penalty=uncertainty_penalty,
    )


def order(plan):
    return plan.scenarios.actions[:, 0].tolist()


def test_reward_comes_first():
    plan = ranked([4, 0, 2, 3], [[0, 0], [1, 0], [1, 1], [-1, 0]])
    assert order(plan) == [2, 1, 0, 3]
    assert plan.returns.tolist() == [2, 1, 0, -1]
    assert plan.actions.tolist() == [2, 2]


def test_what_is_expected_beyond_counts_as_much_as_its_distance_lets_it():
    plan = ranked([0, 0, 0], [[0, 0], [0, 1], [1, 0]], values=[3, 0, 0], discount=0.5)
    assert order(plan) == [2, 0, 1] and plan.returns.tolist() == [1, 0.75, 0.5]
    assert plan.scenarios.values.tolist() == [0, 3, 0]


def test_then_the_furthest_node_on_the_path():
    plan = ranked([1, 3, 0, 4, 2])
    assert order(plan) == [3, 1, 4, 0, 2]
    assert plan.progress.tolist() == plan.end_nodes.tolist() == [4, 3, 2, 1, 0]
    assert (plan.node, plan.path.tolist()) == (0, [0, 1, 2, 3, 4])


def test_progress_counts_from_where_the_state_is():
    plan = ranked([1, 3, 0, 4, 2], start=2.2)
    assert (plan.node, plan.path.tolist()) == (2, [2, 3, 4])
    assert order(plan)[:3] == [3, 1, 4]
    assert plan.progress.tolist() == [2, 1, 0, -1, -1]


def test_then_the_distance_to_the_centroid_of_the_node_reached():
    plan = ranked([2.4, 3.3, 2.1, 2.9, 1.8])
    assert order(plan) == [3, 1, 2, 4, 0]
    assert plan.end_nodes.tolist() == [3, 3, 2, 2, 2]


def test_off_the_path_the_distance_to_its_end_counts():
    plan = ranked([0.1, 1.2, 0.6], start=3)
    assert plan.progress.tolist() == [-1, -1, -1] and plan.path.tolist() == [3, 4]
    assert order(plan) == [1, 2, 0]  # 2.8, 3.4 and 3.9 from the path's end
    on = ranked([2.4, 3.4], start=3)  # on the path, however far from its centroid, before off it
    assert order(on) == [1, 0] and on.progress.tolist() == [0, -1]


def test_each_criterion_only_decides_between_equals():
    """Against sorting by hand, for many mixtures."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        ends = (np.round(rng.uniform(-0.4, 4.4, size=12), 1) + 0.01).astype(np.float32)
        rewards = rng.integers(-1, 2, size=(12, 2))
        start = float(rng.integers(5))
        path = list(range(int(start), 5))

        def key(i, ends=ends, rewards=rewards, path=path):
            node = int(np.abs(np.arange(5) - ends[i]).argmin())
            on_path = node in path
            gap = abs(float(ends[i]) - (node if on_path else path[-1]))
            return (-rewards[i].sum(), -path.index(node) if on_path else 1, gap)

        expected = sorted(range(12), key=key)  # stable, as well
        assert order(ranked(ends, rewards, start=start)) == expected


def test_of_equals_the_first_stays_first():
    assert order(ranked([2, 3, 3, 2, 3])) == [1, 2, 4, 0, 3]
    assert order(ranked([1] * 9)) == list(range(9))
    assert order(ranked([1.25, 0.75, 1.25])) == [0, 1, 2]  # as close from either side


def test_all_of_a_scenario_moves_together():
    ends, rewards = [1, 3.2, 4, 2], [[0, 0], [1, -1], [-1, -1], [0, 1]]
    plan = ranked(ends, rewards)
    for place, number in enumerate(order(plan)):
        assert plan.scenarios.states[place, -1, 0] == np.float32(ends[number])
        assert plan.scenarios.rewards[place].tolist() == rewards[number]
        assert plan.returns[place] == sum(rewards[number])
        assert plan.end_nodes[place] == round(ends[number])


def test_a_discount_prefers_an_early_gain_and_a_late_loss():
    rewards = [[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 0, -1], [0, 0, 0]]
    assert order(ranked([0] * 5, rewards)) == [0, 1, 4, 2, 3]  # without, equal sums are equal
    plan = ranked([0] * 5, rewards, discount=0.5)
    assert order(plan) == [1, 0, 4, 3, 2]
    assert plan.returns.tolist() == [1, 0.25, 0, -0.25, -1]
    assert order(ranked([0] * 2, [[1, 1, -1], [1, -1, 1]], discount=0.9)) == [0, 1]


@pytest.mark.parametrize(("count", "length"), [(4096, 12), (4095, 12), (729, 6), (243, 15)])
def test_equal_rewards_are_equal_returns_however_they_are_counted(count, length):
    """The second criterion decides between them: no rounding may."""
    rewards = np.repeat(np.random.default_rng(0).integers(-1, 2, size=(1, length)), count, axis=0)
    ends = np.zeros(count)
    ends[-1] = 4
    for laid_out in (rewards, np.asfortranarray(rewards)):
        plan = ranked(ends, laid_out, discount=0.95)
        assert len(set(plan.returns.tolist())) == 1
        assert order(plan) == [count - 1, *range(count - 1)]


def test_on_an_empty_map_only_the_reward_counts():
    plan = ranked([3, 1, 2, 0], [[0], [1], [0], [1]], line=LineMap(0))
    assert order(plan) == [1, 3, 0, 2]
    assert (plan.node, plan.path.tolist()) == (-1, [])
    assert plan.end_nodes.tolist() == plan.progress.tolist() == [-1] * 4


def test_without_a_path_a_scenario_that_ends_near_a_centroid_is_better():
    plan = ranked([1.4, 3.1, 0.2, 2.0], line=LineMap(reward=-1.0))
    assert order(plan) == [3, 1, 2, 0] and not plan.seeks_novelty
    assert (plan.node, plan.path.tolist()) == (0, []) and plan.progress.tolist() == [-1] * 4
    assert plan.end_nodes.tolist() == [2, 3, 0, 1]


def test_before_the_first_reward_the_scenario_that_ends_farthest_from_all_nodes_is_best():
    plan = ranked([1.4, 3.1, 0.2, 2.0, 7.0], line=LineMap(reward=0.0))
    assert order(plan) == [4, 0, 2, 1, 3] and plan.seeks_novelty
    predicted = ranked([1.4, 3.1, 7.0], [[0], [1], [0]], line=LineMap(reward=0.0))
    assert order(predicted) == [1, 2, 0]  # the forests may have met one since the map was drawn


def test_doubt_counts_against_a_scenario_as_much_as_asked():
    given = {"ends": [2.0, 2.0, 2.0], "rewards": [[1], [0.8], [0]], "uncertainties": [0.6, 0.1, 0.0]}
    assert order(ranked(**given)) == [0, 1, 2]
    careful = ranked(**given, uncertainty_penalty=1.0)
    assert order(careful) == [1, 0, 2] and careful.returns == pytest.approx([0.7, 0.4, 0.0])
    assert careful.scenarios.uncertainties.tolist() == [0.1, 0.6, 0.0]
    assert order(ranked(**given, uncertainty_penalty=9.0)) == [2, 1, 0]


def test_nothing_given_is_changed():
    line = LineMap()
    ends, rewards = np.array([[2.0], [3.0]], np.float32), np.array([[0], [1]])
    scenarios = Scenarios(
        actions=np.array([[0], [1]]), states=ends[:, None].copy(), rewards=rewards, values=np.zeros(2)
    )
    kept = [array.copy() for array in (scenarios.actions, scenarios.states, scenarios.rewards)]
    plan = rank(scenarios, ends[:1], ends, line, plan_routes(line.graph_, LongTermConfig()))
    plan.scenarios.states[:] = 9
    for array, copy in zip((scenarios.actions, scenarios.states, scenarios.rewards), kept, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_greedy_steps_along_the_path_arrive():
    """Planning again after every step, whatever the start, ends where the gain is."""
    line, arrived = LineMap(), []
    for start in range(5):
        place = start
        for _ in range(4):
            ends = np.clip([place - 1, place, place + 1], 0, 4)
            place = int(ends[order(ranked(ends, start=place, line=line))[0]])
        arrived.append(place)
    assert arrived == [4] * 5
