"""``semrl explain``: what it tells, and that a wrong call is one line."""

import json
import os

import pytest

import semrl.cli.explain as command
from semrl.evaluation import evaluate, load_player
from semrl.evaluation.explaining import explain
from semrl.evaluation.rules import unit_of
from semrl.report import phrases

KEYS = {
    "run", "model", "env", "trained_decisions", "policy", "seed", "episode", "step", "exploration", "return_so_far",
    "features", "place", "path", "cutoff", "scenarios", "n_scenarios", "n_imagined", "reason", "otherwise",
    "plan_features",
    "choice", "rollout", "objects", "joined", "remarks", "html",
}  # fmt: skip


def test_one_json_object(call, map_run):
    result = call("explain", map_run, "--episode", 1, "--step", 6, "--policy", "planner", "--json")
    assert result.status == 0 and result.out.count("\n") == 1
    told = json.loads(result.out)
    assert told.keys() == KEYS and told["html"] is None and told["run"] == str(map_run)
    assert (told["episode"], told["step"], told["policy"]) == (1, 6, "planner")
    wanted = explain(map_run, episode=1, step=6, policy="planner").to_json()
    assert told == json.loads(json.dumps(wanted | {"html": None}))


def test_decisions_under_other_conditions_are_those_of_such_an_evaluation(call, map_run):
    """What lost a game with sticky actions can only be seen in that game."""
    told = evaluate(map_run, episodes=1, sticky_actions=0.5)
    decision = told.rewards[0][0][0]
    explained = call("explain", map_run, "--step", decision, "--sticky-actions", 0.5, "--json")
    assert json.loads(explained.out)["rollout"]["rewards"][0] == told.rewards[0][0][1]
    wrong = call("explain", map_run, "--step", 0, "--at", 7)
    assert wrong.status == 2 and "no milestone of decision 7" in wrong.message


def test_the_state_is_told_in_the_units_of_the_rules(tracked_run):
    features = explain(tracked_run, episode=0, step=3).features
    player = load_player(tracked_run)
    assert unit_of(player) == 0.01 and features.keys() == set(player.encoder.space.names)
    assert max(features.values()) == 100


def test_people_are_told(call, map_run, monkeypatch):
    monkeypatch.setattr(command.console, "width", 400)
    told = next(e for e in (explain(map_run, episode=2, step=k, seed=5) for k in range(45)) if e.path)
    result = call("explain", map_run, "--episode", 2, "--step", told.step, "--seed", 5)
    assert result.status == 0 and "written" not in result.out
    for said in (phrases.seen, phrases.place, phrases.way, phrases.otherwise, phrases.choice, phrases.rollout):
        assert said(told) in result.out
    for scenario in told.scenarios:
        assert phrases.compact(scenario.actions) in result.out
    assert told.reason in result.out and f"Why {told.choice.action}?" in result.out


def test_the_page_is_written(call, map_run, tmp_path):
    page = tmp_path / "[why].html"
    result = call("explain", map_run, "--step", 0, "--html", page)
    assert result.status == 0 and f"written: {page}\n" in result.out
    text = page.read_text()
    told = json.loads(call("explain", map_run, "--step", 0, "--html", page, "--json").out)
    assert told["html"] == str(page) and page.read_text() == text and list(tmp_path.iterdir()) == [page]


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ([], "Missing from semrl explain"),
        (["--step", "-1"], "must be 0 or more"),
        (["--step", "0", "--episode", "-2"], "must be 0 or more"),
        (["--step", "0", "--seed", "-3"], "must be 0 or more"),
        (["--step", "many"], "semrl explain --help"),
        (["--step", "0", "--policy", "me"], "semrl explain --help"),
        (["--step", "0", "--htlm", "why.html"], "did you mean --html?"),
        (["--step", "5000"], "has 45 decisions, from 0 to 44, so there is no decision 5000"),
    ],
)
def test_wrong_calls_cost_one_line(call, map_run, argv, said):
    result = call("explain", map_run, *argv)
    assert result.status == 2 and result.out == "" and result.err.count("\n") == 1
    assert said in result.message


def test_runs_that_cannot_be_explained(call, semantic_run, tmp_path):
    for run, said in ((semantic_run, "has no map"), (tmp_path / "none", "none")):
        result = call("explain", run, "--step", 0, "--json")
        assert result.status == 2 and result.out == "" and result.err.count("\n") == 1
        assert said in result.message


@pytest.mark.parametrize(
    ("name", "said"),
    [("", "it is a folder"), ("none/a.html", "there is no folder"), ("a.html", "nothing may be written")],
)
def test_a_page_that_cannot_be_written_is_told_before_anything_is_played(call, tmp_path, monkeypatch, name, said):
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    monkeypatch.setattr(command, "explain", lambda *_args, **_options: pytest.fail("the episode was played"))
    result = call("explain", "somewhere", "--step", 0, "--html", tmp_path / name)
    assert result.status == 2 and result.out == "" and said in result.message and not any(tmp_path.iterdir())


def test_a_full_disk_keeps_the_old_page(call, map_run, tmp_path, monkeypatch):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    page = tmp_path / "why.html"
    page.write_text("old")
    monkeypatch.setattr(os, "fsync", full)
    result = call("explain", map_run, "--step", 0, "--html", page)
    assert result.status == 1 and "No space left" in result.message and result.out == ""
    assert page.read_text() == "old" and list(tmp_path.iterdir()) == [page]


def test_the_example_of_the_help_works(call, map_run, tmp_path, monkeypatch):
    said = " ".join(call("explain", "--help").out.replace("│", " ").split())
    words = said.partition("Example: semrl explain ")[2].split(" ")[:5]
    assert words[0] == "runs/first" and words[1] == "--step" and words[3] == "--html"
    monkeypatch.chdir(tmp_path)
    assert call("explain", map_run, "--step", 12, *words[3:]).status == 0
    assert (tmp_path / words[4]).exists()
