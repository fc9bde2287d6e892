"""``semrl plan``: what it prints and writes, and what it refuses."""

import json

import pytest


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    from semrl.cli.main import main

    run = tmp_path_factory.mktemp("plan") / "maze"
    assert main(["plan", str(run), "--env", "semrl/DrawnFourRooms-v0", "--decisions", "500", "--goal", "end"]) == 0
    return run


def test_plans_are_told(world, call, tmp_path):
    files = ["--domain", tmp_path / "d.pddl", "--problem", tmp_path / "p.pddl"]
    told = json.loads(call("plan", world, "--goal", "end", "--trials", 2, "--json", *files).out)
    assert told["solved"] == told["trials"] == 2 and told["learned_from"] == 500
    assert (tmp_path / "d.pddl").read_text().startswith("(define (domain")
    assert (tmp_path / "p.pddl").read_text().startswith("(define (problem")
    assert "2 of 2 trials" in call("plan", world, "--goal", "end", "--trials", 2).out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--goal", "nowhere"], "there is no goal"),
        (["--goal", "gain"], "has no gain"),
        (["--goal", "0,0"], "at 0,0 lay solid"),
        (["--goal", "3,40"], "columns, counted from 0"),
        (["--goal", "solid0"], "nothing of solid0 was ever entered"),
        (["--trials", "-1"], "0 or more"),
        (["--env", "semrl/Catch-v0"], "another world"),
    ],
)
def test_bad_calls(world, call, words, said):
    told = call("plan", world, *words)
    assert told.status == 2 and said in told.message


def test_without_play_there_are_no_plans(call, tmp_path):
    told = call("plan", tmp_path)
    assert told.status == 2 and "--env" in told.message
    (tmp_path / "symbols.npz").write_bytes(b"no archive")
    assert call("plan", tmp_path).status == 1
