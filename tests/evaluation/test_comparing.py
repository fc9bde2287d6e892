"""What two runs know and do differently."""

import json
import shutil

import pytest

from semrl.core.errors import SemrlError, UsageError
from semrl.evaluation.comparing import _rules, compare
from semrl.evaluation.player import load_player
from semrl.report.compare import sections, write_comparison
from semrl.training import train
from semrl.world_model.rules import Rule


@pytest.fixture(scope="module")
def other_run(tmp_path_factory, tracked_run):
    """One like `tracked_run`, with another seed."""
    from semrl.training import RunFolder
    from semrl.training.config import from_dict, to_dict

    config = to_dict(RunFolder.open(tracked_run).config())
    path = tmp_path_factory.mktemp("other") / "<b>other"
    train(path, from_dict(config | {"seed": 7, "decisions": 300}, source="other"))
    return path


@pytest.fixture(scope="module")
def found(tracked_run, other_run):
    return compare(tracked_run, other_run, decisions=60)


def rule(about, conditions, value):
    return Rule(about=about, conditions=conditions, value=value, decisions=9, error=0.1)


def test_a_run_compared_with_itself_differs_in_nothing(tracked_run):
    same = compare(tracked_run, tracked_run, decisions=40)
    assert same.settings == {} and same.names.first == same.names.second == ()
    assert not (same.rules.lost or same.rules.added or same.rules.changed) and same.rules.same > 0
    assert same.maps.nodes[0] == same.maps.nodes[1] and same.maps.agreement == 1
    assert same.agreed == 1 and same.partings == () and same.watched > 0


def test_rules_are_paired_by_what_they_depend_on():
    ours = [
        rule("x", ("own y ≤ 3.1", "the action is LEFT"), 2.0),
        rule("x", ("1.5 < object 0 x ≤ 2.5",), -1.0),
        rule("x", ("own y > 3.1",), 4.0),
        rule("y", (), 1.0),
    ]
    theirs = [
        rule("x", ("the action is LEFT", "own y ≤ -8e-05"), 2.05),  # within the twentieth
        rule("x", ("0.1 < object 0 x ≤ 9",), 1.0),
        rule("x", ("own y ≤ 3.1", "the action is RIGHT"), 2.0),
        rule("z", (), 1.0),
    ]
    compared = _rules(ours, theirs)
    assert compared.same == 1
    assert compared.changed == ((ours[1], theirs[1]),)
    assert compared.lost == (ours[2], ours[3])
    assert compared.added == (theirs[2], theirs[3])
    assert _rules(theirs, ours).lost == compared.added


def test_the_first_parting_is_where_their_own_games_part(found, tracked_run, other_run):
    """Played alone, both take the same decisions up to there, and other ones there."""
    assert 0 <= found.agreed < 1 and found.partings
    first = found.partings[0]
    games = []
    for run in (tracked_run, other_run):
        player = load_player(run).under(exploration=0.0)
        games.append([step.action for step in player.episode(0, found.seed) if step.action is not None])
    names = load_player(tracked_run).action_names
    assert games[0][: first.step] == games[1][: first.step]
    assert [names[game[first.step]] for game in games] == [side.action for side in first.deciders]
    for side in first.deciders:
        assert side.action == max(side.values, key=side.values.get)
        assert side.reason and side.planned in names


def test_all_is_told_as_lines_json_and_page(found, tmp_path):
    told = dict(sections(found))
    assert any("seed: 0 → 7" in line for line in told["Settings that differ"])
    assert all(lines for lines in told.values())
    assert json.loads(json.dumps(found.to_dict()))["watched"] == found.watched
    page = write_comparison(found, tmp_path / "page.html").read_text()
    assert "&lt;b&gt;other" in page and "<b>other" not in page
    assert page.count("<figure>") == len(found.partings)


def test_scores_stand_side_by_side(tracked_run, tmp_path):
    runs = [tmp_path / name for name in ("one", "two")]
    for run in runs:
        shutil.copytree(tracked_run, run)
        for path in run.glob("evaluation*.json"):
            path.unlink()
    (runs[0] / "evaluation.json").write_text(json.dumps({"returns": [1, 2, 3, 4]}))
    (runs[1] / "evaluation.json").write_text(json.dumps({"returns": [5]}))
    (runs[1] / "evaluation-planner.json").write_text(json.dumps({"returns": [7, 7]}))
    agent, planner = compare(*runs, decisions=1).scores
    assert agent.name == "evaluation" and agent.episodes == (4, 1)
    assert agent.iqm[0][0] == 2.5 and agent.iqm[0][1] <= 2.5 <= agent.iqm[0][2] and agent.iqm[1] == (5, None, None)
    assert planner.iqm == (None, (7, 7, 7))
    (runs[1] / "evaluation.json").write_text("{}")
    with pytest.raises(SemrlError, match="damaged"):
        compare(*runs, decisions=1)


def test_runs_of_other_games_or_without_maps_are_compared_as_far_as_that_goes(tracked_run, ram_map_run, baseline_run):
    far = compare(tracked_run, ram_map_run)
    assert "other games" in far.no_game and far.partings == () and far.agreed is None
    assert far.maps is not None and far.maps.agreement is None
    plain = compare(baseline_run, tracked_run, decisions=20)
    assert plain.maps is None and plain.rules.same == 0 and plain.watched > 0
    with pytest.raises(UsageError, match="map"):
        compare(baseline_run, tracked_run, policy="planner")


def test_the_command(call, tracked_run, other_run, tmp_path):
    from pathlib import Path

    page = tmp_path / "page.html"
    done = call("compare", tracked_run, other_run, "--decisions", 20, "--page", page, "--json")
    assert done.status == 0, done.err
    keys = ", ".join(f"`{key}`" for key in json.loads(done.out))
    assert f"| `compare` | {keys} |" in (Path(__file__).parents[2] / "docs" / "json.md").read_text() and page.exists()
    lines = call("compare", tracked_run, tracked_run, "--decisions", 5)
    assert lines.status == 0 and "100 % of them" in lines.out
    assert call("compare", tracked_run, tmp_path / "none").status == 2
    assert call("compare", tracked_run, tracked_run, "--decisions", 0).status == 2
