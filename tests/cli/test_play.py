"""``semrl play``: goals that are told, on a run that was trained for the reward."""

import json

import pytest


def test_a_goal_is_played_for_and_told(tracked_run, call):
    told = call("play", tracked_run, "--goal", "thing", "--trials", "2", "--json")
    assert told.status == 0, told.err
    result = json.loads(told.out)
    assert list(result) == ["run", "goal", "trials", "reached", "share", "decisions"]
    assert (result["trials"], result["goal"], len(result["decisions"])) == (2, "thing", 2)
    reached = [one for one in result["decisions"] if one is not None]
    assert len(reached) == result["reached"] and result["share"] == result["reached"] / 2
    again = call("play", tracked_run, "--goal", "thing", "--trials", "2", "--json")
    assert json.loads(again.out) == result


def test_a_summary_is_printed(tracked_run, call):
    told = call("play", tracked_run, "--goal", "always(true)", "--decisions", "5")
    assert told.status == 0 and "1 of 1 trials" in told.out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--goal", "bal"], "there is no class 'bal'"),
        (["--goal", "thing.x <"], "malformed"),
        (["--goal", "thing and not thing"], "contradicts itself"),
        (["--goal", "count(thing) > 20"], "cannot be had"),
        (["--goal", "thing.x < -50"], "cannot be had"),
        (["--goal", "thing", "--avoid", "thing"], "contradicts"),
        (["--goal", "thing", "--until", "thin"], "did you mean 'thing'?"),
        (["--goal", "before(thing, border)", "--until", "thing"], "plain condition"),
        (["--goal", "thing or always(thing)"], "stand at the front"),
        (["--goal", "always(thing, thing)"], "does not take 2 conditions"),
        (["--goal", "thing", "--for", "0"], "1 decision or more"),
        (["--goal", "thing", "--trials", "0"], "1 or more"),
        (["--goal", "thing", "--policy", "nobody"], "policy"),
        ([], "goal"),
    ],
)
def test_what_cannot_be_played_for_is_told_before(tracked_run, call, options, said):
    told = call("play", tracked_run, *options)
    assert (told.status, told.out) == (2, "") and said in told.message


def test_a_run_without_a_map_has_no_goals(objects_run, map_run, call):
    assert "has no map" in call("play", objects_run, "--goal", "own.x < 3").message
    assert call("play", map_run, "--goal", "own.x < 3").status == 2
