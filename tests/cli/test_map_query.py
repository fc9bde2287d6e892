"""``semrl map`` and ``semrl query``: what they tell, and that a wrong call is one line."""

import json
import os
from types import SimpleNamespace

import numpy as np
import pytest

import semrl.cli.map as map_command
import semrl.cli.query as query_command
from semrl.core import MapGraph
from semrl.core.errors import UsageError
from semrl.evaluation import maps
from semrl.knowledge.vocabulary import INSTANCES

GRAPH = MapGraph(
    node_ids=np.arange(3),
    node_means=np.eye(3),
    node_counts=np.array([5, 2, 1]),
    edge_ids=np.arange(4),
    sources=np.array([0, 1, 0, 2]),
    targets=np.array([1, 0, 2, 2]),
    edge_counts=np.array([4, 3, 1, 1]),
    rewards=np.array([0.0, 0.0, 1.0, -1.0]),
    actions=np.array([[1.0, 0.0], [0.25, 0.75], [0.0, 1.0], [1.0, 0.0]]),
)
STATES = "SELECT ?s ?n { ?s a semrl:State; semrl:count ?n } ORDER BY ?s"


def loads(monkeypatch, load):
    monkeypatch.setattr(query_command, "load_map", load)
    monkeypatch.setattr(maps, "load_map", load)
    monkeypatch.setattr(map_command, "load_graph", lambda run: load(run).graph)


@pytest.fixture(autouse=True)
def with_map(monkeypatch):
    loads(
        monkeypatch, lambda _run: SimpleNamespace(graph=GRAPH, action_names=("NOOP", "FIRE"), rules=(), base=INSTANCES)
    )


def only_json(result):
    assert result.status == 0, result.err
    assert result.out.count("\n") == 1
    return json.loads(result.out)


def test_map_describes(call):
    assert only_json(call("map", "somewhere", "--json")) == {
        "run": "somewhere", "nodes": 3, "edges": 4, "positive": 0.25, "negative": 0.25, "diameter": 1, "radius": 1,
        "component_nodes": 2, "states": 8, "transitions": 9, "export": None,
    }  # fmt: skip
    result = call("map", "somewhere")
    assert result.status == 0 and "3, for 8 states" in result.out and "25.0%" in result.out
    assert "1 and 1 steps" in result.out


@pytest.mark.parametrize("suffix", [".graphml", ".gexf", ".ttl", ".TTL"])
def test_map_exports(call, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    path.write_text("old")
    assert only_json(call("map", "somewhere", "--export", path, "--json"))["export"] == str(path)
    assert len(path.read_bytes()) > 1000 and list(tmp_path.iterdir()) == [path]
    assert f"written: {path}\n" in call("map", "somewhere", "--export", path).out


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("map.json", "exported as .graphml, .gexf, .ttl, not as .json"),
        ("map", "not as map"),
        ("none/map.ttl", "there is no folder"),
        ("folder.ttl", "it is a folder"),
        ("file.txt/map.ttl", "there is no folder"),
        ("locked/map.ttl", "nothing may be written to"),
    ],
)
def test_a_file_that_cannot_be_written_is_told_before_anything_is_loaded(call, tmp_path, monkeypatch, name, said):
    (tmp_path / "folder.ttl").mkdir()
    (tmp_path / "locked").mkdir()
    (tmp_path / "file.txt").write_text("kept")
    monkeypatch.setattr(os, "access", lambda path, _mode: "locked" not in str(path))
    monkeypatch.setattr(maps, "load_map", lambda _run: pytest.fail("the run was loaded"))
    before = sorted(tmp_path.rglob("*"))
    result = call("map", "somewhere", "--export", tmp_path / name)
    assert result.status == 2 and said in result.message and result.out == "" and result.err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before and (tmp_path / "file.txt").read_text() == "kept"


def test_a_full_disk_keeps_the_old_file(call, tmp_path, monkeypatch):
    path = tmp_path / "map.ttl"
    path.write_text("old")

    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    result = call("map", "somewhere", "--export", path)
    assert result.status == 1 and "No space left" in result.message and result.out == ""
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_query_selects_and_asks(call):
    told = only_json(call("query", "somewhere", STATES, "--json"))
    rows = [["map:state-0", 5], ["map:state-1", 2], ["map:state-2", 1]]
    assert told == {"run": "somewhere", "variables": ["s", "n"], "rows": rows, "truncated": False}
    asked = only_json(call("query", "somewhere", "ASK { map:state-0 semrl:leadsTo+ map:state-2 }", "--json"))
    assert asked == {"run": "somewhere", "truth": True}


def test_query_tells_people(call):
    told = call("query", "somewhere", STATES)
    assert told.status == 0 and told.err == "" and "map:state-2" in told.out
    cut = call("query", "somewhere", STATES, "--rows", 2)
    assert "map:state-1" in cut.out and "map:state-2" not in cut.out and "first 2 rows" in cut.err
    assert call("query", "somewhere", "ASK { ?x semrl:reward 9 }").out == "no\n"
    assert "Nothing fits" in call("query", "somewhere", "SELECT * { ?x semrl:reward 9 }").err
    odd = call("query", "somewhere", "SELECT ('[red]x[/red]' AS ?x) (1/0 AS ?y) {}")
    assert "[red]x[/red]" in odd.out


def test_the_example_of_the_help_works(call):
    said = " ".join(call("query", "--help").out.replace("│", " ").split())
    query = said.partition("semrl query runs/first '")[2].partition("'")[0]
    assert query.startswith("SELECT") and "LIMIT 5" in query
    told = only_json(call("query", "somewhere", query, "--json"))
    assert told["variables"] == ["from", "to", "reward"] and told["rows"][0] == ["map:state-0", "map:state-2", 1.0]


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["map"], "Missing from semrl map"),
        (["map", "RUN", "--exprot", "a.ttl"], "did you mean --export?"),
        (["query", "RUN"], "semrl query --help"),
        (["query", "RUN", "SELECT * { SERVICE <http://x> {} }"], "SERVICE is not allowed"),
        (["query", "RUN", "DROP ALL", "--json"], "the query cannot be answered"),
        (["query", "RUN", "SELECT *\n{"], "the query cannot be answered: error at 2:"),
        (["query", "RUN", "ASK {}", "--rows", "0"], "rows must be 1 or more"),
        (["query", "RUN", "ASK {}", "--seconds", "nan"], "seconds must be above 0"),
    ],
)
def test_wrong_calls_cost_one_line(call, argv, said):
    result = call(*argv)
    assert result.status == 2 and result.out == "" and result.err.count("\n") == 1
    assert said in result.message


@pytest.mark.parametrize("argv", [["map"], ["map", "--json"], ["query", "ASK {}"]])
def test_without_a_map_there_is_one_line(call, monkeypatch, argv):
    argv = [argv[0], "somewhere", *argv[1:]]

    def none(run):
        raise UsageError(f"{run} has no map; train one with --model ram-map")

    loads(monkeypatch, none)
    result = call(*argv)
    assert result.status == 2 and result.out == "" and "has no map" in result.message
