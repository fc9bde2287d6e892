"""What an explanation says is what happens."""

import json
import math
import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs import ram_features
from semrl.evaluation import load_player
from semrl.evaluation.explaining import explain
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.evaluation.sight import look
from semrl.report.phrases import otherwise, place
from semrl.training import RunFolder, train
from semrl.training.config import write_toml

NAMES = ("LEFT", "RIGHT")
HORIZON = 3
STEPS = (0, 1, 6, 20, 41)


@pytest.fixture(scope="module")
def hasty_run(tmp_path_factory, map_run):
    """The run with a map, but evaluated with half of its actions at random."""
    path = shutil.copytree(map_run, tmp_path_factory.mktemp("runs") / "hasty")
    config = RunFolder.open(path).config()
    (path / "config.toml").write_text(
        write_toml(replace(config, evaluation=replace(config.evaluation, exploration=0.5)))
    )
    return path


def played(run, episode=1, policy="agent"):
    player = load_player(run)
    return player, list(player.episode(episode, player.config.seed + EVALUATION_SEED, policy))


@pytest.mark.parametrize("policy", ["agent", "planner"])
def test_it_is_the_decision_that_an_evaluation_takes(map_run, policy):
    player, steps = played(map_run, policy=policy)
    for k in STEPS:
        told = explain(map_run, episode=1, step=k, policy=policy)
        assert told.choice.action == NAMES[steps[k + 1].action]
        assert told.choice.action == getattr(told.choice, policy) and not told.choice.by_chance
        assert told.return_so_far == steps[k].total
        np.testing.assert_array_equal(told.frame, steps[k].observation.frame)
        _, sight = look(player.encoder.begin(), steps[k].observation)
        np.testing.assert_array_equal(told.sight.boxes_px, sight.boxes_px)
        values = player.agent.action_values(steps[k].shown)
        assert list(told.choice.values) == list(NAMES)
        np.testing.assert_allclose(list(told.choice.values.values()), values, rtol=1e-5)
        assert told.choice.agent == NAMES[values.argmax()]


def test_chance_is_told(hasty_run):
    _, steps = played(hasty_run)
    told = [explain(hasty_run, episode=1, step=k) for k in range(12)]
    assert [e.choice.action for e in told] == [NAMES[step.action] for step in steps[1:13]]
    assert {e.choice.by_chance for e in told} == {True, False}
    assert all(e.choice.by_chance == (e.choice.action != e.choice.agent) and e.exploration == 0.5 for e in told)


def test_the_place_and_the_path_are_those_of_the_map(map_run):
    player, steps = played(map_run)
    graph, routes = player.planning.state_map.graph_, player.planning.routes
    edges = {int(number): i for i, number in enumerate(graph.edge_ids)}
    lengths = set()
    for k in range(0, len(steps) - 1, 4):
        told = explain(map_run, episode=1, step=k)
        node = steps[k].record.plan.node
        assert told.place.node == graph.node_ids[node] and told.place.states == graph.node_counts[node]
        assert told.place.is_goal == routes.goals[node]
        lengths.add(len(told.path))
        if not told.path:
            assert told.place.distance is None and np.isinf(routes.distances[node])
            continue
        assert told.place.distance == routes.distances[node]
        assert sum(hop.cost for hop in told.path[:-1]) == pytest.approx(routes.distances[node])
        assert [hop.source for hop in told.path] == graph.node_ids[routes.path(node)].tolist()
        assert all(first.target == second.source for first, second in pairwise(told.path))
        assert told.path[-1].reward >= 0.5
        for hop in told.path:
            i = edges[hop.edge]
            assert (hop.source, hop.target) == (graph.node_ids[graph.sources[i]], graph.node_ids[graph.targets[i]])
            assert hop.reward == graph.rewards[i] and hop.count == graph.edge_counts[i]
            assert hop.action == NAMES[graph.actions[i].argmax()] and 0.5 <= hop.share <= 1
    assert 0 in lengths and max(lengths) > 1


def test_scenarios_are_sorted_and_those_of_the_planner(map_run):
    _, steps = played(map_run)
    for k in STEPS:
        told = explain(map_run, episode=1, step=k)
        plan = steps[k].record.plan
        returns = [scenario.predicted_return for scenario in told.scenarios]
        assert returns == sorted(returns, reverse=True) == plan.returns[:5].tolist()
        assert told.n_scenarios == 2**HORIZON and [scenario.rank for scenario in told.scenarios] == [1, 2, 3, 4, 5]
        assert len({scenario.actions for scenario in told.scenarios}) == 5
        assert told.choice.planner == told.scenarios[0].actions[0] and told.reason
        for i, scenario in enumerate(told.scenarios):
            assert len(scenario.actions) == len(scenario.rewards) == HORIZON
            assert scenario.predicted_return == sum(scenario.rewards)  # nothing is discounted here
            assert scenario.uncertainty is None  # one model
            assert [NAMES.index(name) for name in scenario.actions] == plan.scenarios.actions[i].tolist()
            on_path = [hop.source for hop in told.path]
            if scenario.progress is None:
                assert scenario.end_node not in on_path
            else:
                assert on_path[scenario.progress] == scenario.end_node


def test_what_the_other_action_would_bring_is_told(map_run):
    """All scenarios are compared here, so those that begin with it are among them."""
    _, steps = played(map_run)
    for k in STEPS:
        told, plan = explain(map_run, episode=1, step=k), steps[k].record.plan
        (other,) = told.otherwise
        begins = plan.scenarios.actions[:, 0] == NAMES.index(other.actions[0])
        assert other.actions[0] != told.scenarios[0].actions[0] and other.predicted_return == plan.returns[begins].max()
        assert [NAMES.index(name) for name in other.actions] == plan.scenarios.actions[begins][0].tolist()
        assert otherwise(told).startswith(f"{other.actions[0]} now brings ")


def test_equal_scenarios_are_told_once(tracked_run):
    """Drawn sequences may be drawn twice."""
    for k in range(0, 40, 4):
        told = explain(tracked_run, episode=0, step=k)
        assert len({scenario.actions for scenario in told.scenarios}) == len(told.scenarios) <= told.n_scenarios
        ranks = [scenario.rank for scenario in told.scenarios]
        assert ranks == sorted(ranks) and ranks[0] == 1


def test_the_plan_features_are_what_the_agent_was_shown(map_run):
    player, steps = played(map_run)
    told = explain(map_run, episode=1, step=6)
    assert [part.part for part in told.plan_features] == ["actions", "state", "reward"]
    shown = [number for part in told.plan_features for number in part.numbers]
    assert shown == steps[6].shown.plan.tolist() and len(shown) == player.planning.plan_size
    assert told.plan_features[0].names == told.scenarios[0].actions
    assert told.plan_features[2].numbers == (told.scenarios[0].predicted_return,)


def test_what_came_is_what_was_played(map_run):
    _, steps = played(map_run)
    for k in STEPS:
        came = explain(map_run, episode=1, step=k).rollout
        after = steps[k : k + HORIZON + 1]
        actions = [step.action for step in after[1:]]
        assert came.actions == tuple(NAMES[action] for action in actions)
        assert came.rewards == tuple(b.total - a.total for a, b in pairwise(after))
        assert came.ended == (k + HORIZON >= len(steps) - 1)
        scenarios = steps[k].record.plan.scenarios
        same = (scenarios.actions == actions).all(axis=1)  # every sequence of actions is among them
        assert came.predicted == tuple(scenarios.rewards[same][0].tolist())


def test_the_last_decisions_of_an_episode(map_run):
    _, steps = played(map_run)
    last = len(steps) - 2
    came = [explain(map_run, episode=1, step=k).rollout for k in range(last - HORIZON, last + 1)]
    assert [len(one.actions) for one in came] == [len(one.predicted) for one in came] == [3, 3, 2, 1]
    assert [one.ended for one in came] == [False, True, True, True]


def test_it_survives_json(map_run):
    told = explain(map_run, episode=1, step=6).to_json()
    again = json.loads(json.dumps(told, allow_nan=False))
    assert again == json.loads(json.dumps(again)) and again.keys() == told.keys()
    assert again["scenarios"][0]["actions"] == list(told["scenarios"][0]["actions"])
    assert "frame" not in again and len(again["objects"]) > 1
    assert again["objects"][0].keys() == {"class", "box_px"} and len(again["objects"][0]["box_px"]) == 4


def test_without_a_cutoff_json_and_words_name_none(map_run):
    told = replace(explain(map_run, episode=1, step=6), cutoff=math.inf)
    assert told.to_json()["cutoff"] is None
    nowhere = replace(told, place=replace(told.place, is_goal=False, distance=None))
    assert place(nowhere).endswith("No way to a gain is known.")


def test_the_numbers_of_a_ram_model_have_names(ram_map_run):
    told = explain(ram_map_run, episode=0, step=9)
    _, steps = played(ram_map_run, 0)
    assert list(told.features) == ["player_y", "enemy_y", "ball_x", "ball_y"]
    coordinates = ram_features("pong", steps[9].observation.ram)
    assert list(told.features.values()) == pytest.approx((255 * coordinates).tolist())  # as the rules tell them
    assert told.plan_features[1].names == tuple(told.features)
    assert told.to_json()["objects"] == []


def test_tracked_objects_are_drawn_with_the_names_they_have_in_the_episode(tracked_run):
    """Tracks are those of the whole episode up to the decision."""
    player, steps = played(tracked_run, 0)
    episode = player.encoder.begin()
    for step in steps[:21]:
        episode.encode(step.observation)
    told = explain(tracked_run, episode=0, step=20)
    assert told.sight.names == episode.look().names and told.sight.names
    np.testing.assert_array_equal(told.sight.boxes_px, episode.look().boxes_px)
    facts = steps[20].state.facts[: len(told.features)] / np.float32(0.01)
    assert list(told.features.values()) == pytest.approx(facts.tolist())


def test_another_seed_is_another_game(map_run):
    usual = explain(map_run, episode=1, step=6)
    assert usual.seed == EVALUATION_SEED
    same = explain(map_run, episode=1, step=6, seed=EVALUATION_SEED)
    other = explain(map_run, episode=1, step=6, seed=5)
    assert same.to_json() == usual.to_json()
    assert (other.frame != usual.frame).any()


@pytest.mark.parametrize("wrong", [{"episode": -1}, {"step": -1}, {"seed": -1}])
def test_negative_numbers_are_refused(map_run, wrong):
    with pytest.raises(UsageError, match="must be 0 or more"):
        explain(map_run, **{"episode": 0, "step": 0, **wrong})


def test_an_episode_that_is_over_is_told_with_its_length(map_run):
    _, steps = played(map_run)
    for k in (len(steps) - 1, 10_000):
        with pytest.raises(UsageError, match=f"has {len(steps) - 1} decisions, from 0 to {len(steps) - 2}, so .* {k}$"):
            explain(map_run, episode=1, step=k)


def test_a_run_without_a_map_is_refused(semantic_run, tmp_path, tiny):
    with pytest.raises(UsageError, match="'semantic', which has no map"):
        explain(semantic_run, episode=0, step=0)
    with pytest.raises(UsageError):
        explain(tmp_path, episode=0, step=0)
    train(tmp_path / "short", tiny("ram-map"))  # its first episode does not end
    with pytest.raises(UsageError, match="is still empty"):
        explain(tmp_path / "short", episode=0, step=0)
