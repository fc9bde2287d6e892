"""Runs whose agent is told plans: what they measure, and playing by plans alone."""

import csv
import json
import shutil
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest
from stopping import stopped

from semrl.core.errors import SemrlError, UsageError
from semrl.evaluation import evaluate, load_map, load_player
from semrl.evaluation.explaining import explain
from semrl.evaluation.prediction import world_model_accuracy
from semrl.evaluation.rules import load_rules
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.training import RunFolder, train
from semrl.training.metrics import read_metrics

EPISODE_DECISIONS = 45  # of Catch: five balls of nine decisions
MAP_COLUMNS = ("map_nodes", "map_edges", "seconds_map", "seconds_next_state", "seconds_reward", "seconds_routes")


@pytest.fixture
def own_run(tmp_path, map_run):
    """A copy of the run that may be written to."""
    return shutil.copytree(map_run, tmp_path / "run")


def rows_of(run):
    rows = read_metrics(run / "metrics.csv")
    agent = [row for row in rows if row["phase"] == "agent"]
    return [row for row in rows if row["phase"] != "agent"], agent


def test_the_map_is_measured_after_each_episode_and_only_then(map_run):
    perception, episodes = rows_of(map_run)
    assert len(episodes) >= 2 and perception
    assert all(row[name] != "" for row in episodes for name in MAP_COLUMNS)
    assert all(row[name] == "" for row in perception for name in MAP_COLUMNS)
    nodes, edges = ([int(row[name]) for row in episodes] for name in ("map_nodes", "map_edges"))
    assert 0 < nodes[0] <= EPISODE_DECISIONS + 1 and 0 < edges[0] <= EPISODE_DECISIONS
    assert nodes == sorted(nodes) and edges == sorted(edges)  # without a limit a map only grows
    with (map_run / "metrics.csv").open(newline="") as file:
        seconds = [float(row["seconds_next_state"]) for row in csv.DictReader(file) if row["phase"] == "agent"]
    assert all(value > 0 for value in seconds)


def test_of_training_episodes_so_many_are_played_by_the_planner(tracked_run):
    _, episodes = rows_of(tracked_run)
    policies = [row["policy"] for row in episodes]
    assert policies == [("agent", "planner")[i % 2] for i in range(len(episodes))] and "planner" in policies
    result = RunFolder.open(tracked_run).manifest()["result"]
    assert result["episodes"] == policies.count("agent")  # what the planner earned is not the agent's
    own = [float(row["return"]) for row in episodes if row["policy"] == "agent"]
    assert result["return_mean_last10"] == pytest.approx(np.mean(own[-10:]))


def test_models_without_a_map_measure_none(semantic_run):
    _, episodes = rows_of(semantic_run)
    assert episodes and not any(row.get(name) for row in episodes for name in MAP_COLUMNS)


def test_the_map_can_be_looked_at(map_run):
    loaded = load_map(map_run)
    _, episodes = rows_of(map_run)
    graph = loaded.graph
    assert (len(graph), len(graph.edge_ids)) == tuple(int(episodes[-1][name]) for name in MAP_COLUMNS[:2])
    assert graph.edge_counts.sum() == EPISODE_DECISIONS * len(episodes)
    assert graph.node_counts.sum() == (EPISODE_DECISIONS + 1) * len(episodes)
    assert loaded.action_names == ("LEFT", "RIGHT") and graph.actions.shape[1] == 2
    total = sum(float(row["return"]) for row in episodes)
    assert graph.edge_counts @ graph.rewards == pytest.approx(total)


def test_a_finished_run_plans_as_it_would_have(map_run):
    """What is kept of a finished run is enough: the plan stands beside the state, and the planner's choice is it."""
    player = load_player(map_run)
    planning, shape = player.planning, player.encoder.space.shape
    steps = list(player.episode(0, 1, "planner"))
    assert len(steps) == EPISODE_DECISIONS + 1
    assert steps[0].shown.vectors.shape == (2, *shape) and steps[0].shown.plan.shape == (planning.plan_size,)
    for before, step in pairwise(steps):
        vectors, plan = before.shown.vectors, before.record.plan
        np.testing.assert_array_equal(vectors[0], player.encoder.begin().encode(before.observation).vector)
        np.testing.assert_array_equal(step.shown.vectors[1], vectors[0])
        np.testing.assert_array_equal(before.shown.plan, planning.grounder.ground(plan))
        assert step.action == planning.plan(before.record.history).actions[0] == plan.actions[0]


def test_the_planner_plays_and_leaves_the_agents_result_alone(own_run):
    agent = evaluate(own_run, episodes=2)
    written = (own_run / "evaluation.json").read_bytes()
    planner = evaluate(own_run, episodes=3, policy="planner")
    assert (own_run / "evaluation.json").read_bytes() == written
    told = json.loads((own_run / "evaluation-planner.json").read_text())
    provenance = told["conditions"]
    assert told == json.loads(json.dumps(asdict(planner)))
    assert (agent.policy, planner.policy, planner.episodes) == ("agent", "planner", 3)
    config = RunFolder.open(own_run).config()
    assert provenance["seed"] == config.seed + EVALUATION_SEED and provenance["decisions"] == config.decisions
    assert evaluate(own_run, episodes=3, policy="planner") == planner  # and it plays the same again


def test_other_conditions_leave_the_plain_result_alone_and_stand_in_the_files_name(own_run):
    plain = evaluate(own_run, episodes=2)
    written = (own_run / "evaluation.json").read_bytes()
    shaken = evaluate(own_run, episodes=2, exploration=1.0)
    assert (own_run / "evaluation.json").read_bytes() == written
    told = json.loads((own_run / "evaluation-random-1.json").read_text())
    assert told["conditions"]["exploration"] == 1.0 and told == json.loads(json.dumps(asdict(shaken)))
    assert shaken.lengths != plain.lengths or shaken.returns != plain.returns
    evaluate(own_run, episodes=1, policy="planner", sticky_actions=0.25)
    path = own_run / "evaluation-planner-sticky-0.25.json"
    assert json.loads(path.read_text())["conditions"]["sticky_actions"] == 0.25


def test_playing_by_plans_learns_nothing(own_run):
    before = [path.read_bytes() for path in sorted((own_run / "checkpoints").iterdir())]
    graph = load_map(own_run).graph
    evaluate(own_run, episodes=1, policy="planner")
    assert [path.read_bytes() for path in sorted((own_run / "checkpoints").iterdir())] == before
    np.testing.assert_array_equal(load_map(own_run).graph.edge_counts, graph.edge_counts)


def test_what_a_finished_run_keeps_is_enough_to_learn_from_further_play(tracked_run):
    player = load_player(tracked_run, memory=True)
    assert not len(load_player(tracked_run).planning.world_model.experience)
    seen = player.planning.world_model.seen_
    assert len(player.planning.world_model.experience) == seen > 0
    *steps, last = player.episode(0, 3, "planner")
    player.planning.end_episode(last.state.facts)
    assert player.planning.world_model.seen_ == seen + len(steps)


def test_without_a_map_the_planner_cannot_play(semantic_run):
    for ask in (lambda: evaluate(semantic_run, policy="planner"), lambda: load_map(semantic_run)):
        with pytest.raises(UsageError, match=r"model 'semantic', which has no map; .* semantic-map or .* objects-map"):
            ask()
    assert not (semantic_run / "evaluation-planner.json").exists()


def test_without_predictions_there_are_no_plans_to_tell_of(tmp_path, tracked_run):
    run = tmp_path / "early"
    config = RunFolder.open(tracked_run).config()
    trees = replace(config.planning.trees, first_decisions=10_000)
    train(run, replace(config, planning=replace(config.planning, trees=trees)))
    assert len(load_map(run).graph)
    asked = (
        lambda: evaluate(run, policy="planner"), lambda: explain(run, episode=0, step=0),
        lambda: world_model_accuracy(run),        lambda: load_rules(run),
    )  # fmt: skip
    for ask in asked:
        with pytest.raises(UsageError, match="early cannot predict anything yet, so there are no plans: it needs more"):
            ask()


def test_the_map_is_empty_until_the_first_episode_is_over(tmp_path, tiny):
    perceived = 4 + 12 + 12 + 12  # detection, reduction, clustering, scenery; a run stops a decision after the signal
    run = stopped(tmp_path / "early", tiny("semantic-map"), perceived + EPISODE_DECISIONS - 2)
    for ask in (lambda: evaluate(run, policy="planner"), lambda: load_map(run)):
        with pytest.raises(UsageError, match="still empty: it is drawn after the agent's first episode"):
            ask()
    assert evaluate(run, episodes=1).policy == "agent"  # who is told zeros until then
    late = stopped(tmp_path / "late", tiny("semantic-map"), perceived + EPISODE_DECISIONS - 1)
    assert len(load_map(late).graph) > 0
    assert evaluate(late, episodes=1, policy="planner").episodes == 1


def test_before_it_can_see_no_one_plays(tmp_path, tiny):
    run = stopped(tmp_path / "blind", tiny("semantic-map"), 8)
    with pytest.raises(UsageError, match="has not learned to see yet"):
        evaluate(run, policy="planner")
    with pytest.raises(UsageError, match="still empty"):
        load_map(run)


def test_stopped_and_resumed_it_ends_like_the_unbroken_one(tmp_path, tiny, map_run):
    """Stopped while perception learns, within the first episode and within a later one."""
    run = tmp_path / "run"
    stopped(run, tiny("semantic-map"), 20)
    for decision in (60, 110):
        stopped(run, None, decision)
    train(run)
    assert RunFolder.open(run).manifest()["hashes"] == RunFolder.open(map_run).manifest()["hashes"]
    told = [
        [{name: value for name, value in row.items() if not name.startswith("seconds")} for row in read_metrics(path)]
        for path in (run / "metrics.csv", map_run / "metrics.csv")
    ]
    assert told[0] == told[1]


def test_ram_models_have_maps_too(tmp_path, tiny):
    """An episode of Pong is long: without one, all is wired and the map still empty."""
    train(tmp_path / "run", tiny("ram-map", decisions=50))
    player = load_player(tmp_path / "run")
    assert player.planning.dimension == player.encoder.space.n_facts == 4
    with pytest.raises(UsageError, match="still empty"):
        load_map(tmp_path / "run")


@pytest.mark.parametrize("setting", [{"planning__scenarios__depth": 20}])
def test_too_many_scenarios_are_told_before_anything_is_written(tmp_path, tiny, setting):
    with pytest.raises(UsageError, match=r"scenarios\.depth"):
        train(tmp_path / "run", tiny("semantic-map", **setting))
    assert not (tmp_path / "run").exists()


def test_a_model_that_diverges_is_told(tmp_path, tiny):
    with pytest.raises(SemrlError, match="diverged: try a smaller learning rate"):
        train(tmp_path / "run", tiny("semantic-map", planning__networks__next_state__learning_rate=1e30))
    assert RunFolder.open(tmp_path / "run").manifest()["status"] == "failed"
