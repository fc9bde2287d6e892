"""What happens in an episode, told by the command; and rules about concepts."""

import json
from collections import Counter

import pytest

from semrl.cli import main
from semrl.core.errors import UsageError
from semrl.evaluation.happenings import load_events
from semrl.evaluation.rules import load_rules
from semrl.knowledge.events import KINDS
from semrl.training import train


@pytest.fixture(scope="module")
def lifted_run(tmp_path_factory, tiny):
    """A finished run that predicts in concepts. Read only."""
    path = tmp_path_factory.mktemp("runs") / "lifted"
    changes = {
        "planning__world_model": "lifted",
        "planning__scenarios__scenarios": 6,
        "planning__lifted__first_decisions": 60,
        "planning__concepts__least_seen": 5,
    }
    train(path, tiny("objects-map", decisions=400, **changes))
    return path


def test_events_of_a_game_are_told(lifted_run, capsys):
    assert main(["events", str(lifted_run), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told) == ["run", "events"] and told["events"]
    assert [list(event) for event in told["events"]] == [
        ["decision", "kind", "things", "concepts", "axis", "amount"] for _ in told["events"]
    ]
    kinds = Counter(event["kind"] for event in told["events"])
    assert set(kinds) <= set(KINDS) and kinds["gain"] + kinds["loss"] >= 1  # every ball is caught or missed
    times = [event["decision"] for event in told["events"]]
    assert times == sorted(times)
    again = load_events(lifted_run)
    assert [event.kind for event in again] == [event["kind"] for event in told["events"]]


def test_some_kinds_of_events_are_told_alone(lifted_run, capsys):
    assert main(["events", str(lifted_run), "--kinds", "gain", "loss"]) == 0
    assert "reward" in capsys.readouterr().out
    assert main(["events", str(lifted_run), "--kinds", "explosion"]) == 2
    assert "contact, bounce" in capsys.readouterr().err


def test_runs_without_concepts_are_told_so(map_run, objects_run, capsys):
    for run, why in ((map_run, "knows no concepts"), (objects_run, "has no map")):
        assert main(["events", str(run)]) == 2
        assert why in capsys.readouterr().err


def test_rules_are_about_concepts(lifted_run):
    for rule in load_rules(lifted_run):
        assert rule.claim and 0 <= rule.right <= rule.decisions and rule.about.split()[0] != "number"
    with pytest.raises(UsageError, match="predicts by 'lifted', which has no rules to read"):
        load_rules(lifted_run, trees=True)
