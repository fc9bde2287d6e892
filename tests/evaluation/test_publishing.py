"""A published run plays as the run does, and its card can be read by others."""

import json

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.evaluation import evaluate, load_encoder
from semrl.evaluation.player import load_player
from semrl.evaluation.publishing import publish
from semrl.training import RunFolder, train


@pytest.fixture(scope="module")
def published(tracked_run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("published") / "model"
    publish(tracked_run, folder)
    return folder


def test_it_plays_as_the_run_does(published, tracked_run):
    (ours, theirs) = (
        [(step.action, step.reward) for step in load_player(run).episode(0, 5)] for run in (published, tracked_run)
    )
    assert ours == theirs and len(ours) > 10
    assert evaluate(published, episodes=1, seed=3).returns == evaluate(tracked_run, episodes=1, seed=3).returns
    frame = load_player(tracked_run).new_game(0).reset()
    vectors = [load_encoder(run).begin().encode(frame).vector for run in (published, tracked_run)]
    np.testing.assert_array_equal(*vectors)


def test_it_holds_what_play_needs_and_nothing_of_this_machine(published, tracked_run):
    assert set(RunFolder(published).load().arrays) == set(RunFolder(tracked_run).load(play_only=True).arrays)
    size, whole = (sum(f.stat().st_size for f in run.rglob("*.npz")) for run in (published, tracked_run))
    assert size < whole
    told = (published / "manifest.json").read_text()
    assert "machine" not in told and str(tracked_run) not in told
    assert train(published).run == str(published)  # a finished run, that tells its result


def test_what_cannot_be_published_is_told(tracked_run, published, tmp_path, tiny):
    with pytest.raises(UsageError, match="exists"):
        publish(tracked_run, published)
    RunFolder.create(tmp_path / "new", tiny("semantic"))
    with pytest.raises(UsageError, match="not finished"):
        publish(tmp_path / "new", tmp_path / "to")
    assert not (tmp_path / "to").exists()


def test_the_command_writes_a_card_with_a_head_that_yaml_reads(call, tracked_run, tmp_path):
    yaml = pytest.importorskip("yaml")
    evaluate(tracked_run, episodes=2, seed=1, policy="planner")
    to = tmp_path / "to"
    done = call("publish", tracked_run, "--to", to, "--json")
    assert done.status == 0, done.err
    assert list(json.loads(done.out)) == ["run", "folder", "card", "bytes"]
    _, head, body = (to / "README.md").read_text().split("---\n", 2)
    values = yaml.safe_load(head)
    assert values["library_name"] == "semrl" and "reinforcement-learning" in values["tags"]
    told = json.loads((to / "evaluation-planner.json").read_text())
    (model,) = values["model-index"]
    metrics = {metric["name"]: metric for result in model["results"] for metric in result["metrics"]}
    assert metrics["evaluation-planner"]["value"] == f"{told['mean']:.2f} +/- {told['std']:.2f}"
    assert f"| evaluation-planner | planner | 2 | {told['mean']:.2f}" in body and "## What it has learned" in body
    assert told["run"] == "" and call("publish", tracked_run, "--to", to).status == 2
    assert call("rules", to, "--most", 1).status == 0
