"""``semrl knowledge``: what a run knows is listed, edited with a log and undo, exported; forbidden classes shield."""

import json
import re
import shutil

import numpy as np
import pyoxigraph as ox
import pytest

from semrl.core.errors import UsageError
from semrl.evaluation import evaluate, explain
from semrl.evaluation.knowledge import load_knowledge
from semrl.evaluation.player import load_player
from semrl.evaluation.shield import shielded
from semrl.knowledge.edits import Edit, write_log
from semrl.knowledge.manchester import read_manchester
from semrl.planning.goal_planner import GoalPlanner


@pytest.fixture
def run(tracked_run, tmp_path):
    """A copy of a run, whose knowledge may be edited."""
    shutil.copytree(tracked_run, tmp_path / "run")
    return tmp_path / "run"


def classes(call, run):
    return {one["name"]: one for one in json.loads(call("knowledge", run, "--json").out)["classes"]}


def test_edits_are_kept_and_taken_back(run, call):
    before = classes(call, run)
    assert call("knowledge", run, "add", "Upper", "thing.y < 40", "--forbid").status == 0
    assert call("knowledge", run, "add", "Both", "Upper and count(thing) > 1").status == 0
    found = classes(call, run)
    assert found["Upper"]["forbidden"] and found["Upper"]["condition"] == "thing.y < 40.0"
    assert not found["Both"]["forbidden"]
    assert call("knowledge", run, "disable", "Upper").status == 0
    assert not classes(call, run)["Upper"]["enabled"]
    for _ in range(3):
        assert call("knowledge", run, "undo").status == 0
    assert classes(call, run) == before
    assert "no edit" in call("knowledge", run, "undo").message
    assert len((run / "knowledge.jsonl").read_text().splitlines()) == 6


def test_classes_that_play_teaches_are_listed_and_can_be_used(run, call):
    learned = {name: one for name, one in classes(call, run).items() if one["origin"] == "learned"}
    assert learned and set(learned) <= {"Danger", "Chance"}
    assert all(one["support"] > 0 and 0 <= one["error"] < 0.5 for one in learned.values())
    name = next(iter(learned))
    assert f"{name} (learned): {learned[name]['condition']}" in call("knowledge", run).out
    assert call("knowledge", run, "add", "Both", f"{name} and count(thing) > 1").status == 0
    assert call("knowledge", run, "disable", name).status == 0
    assert not classes(call, run)[name]["enabled"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["add", "Empty", "thing and not thing"], "nothing could be of the class Empty"),
        (["add", "thing", "autonomous"], "word of the run already"),
        (["add", "Own Class", "thing"], "made of letters"),
        (["add", "A", "A and thing"], "no class 'A'"),
        (["add", "A"], "takes 2 words"),
        (["assert", "disjoint(thing, autonomous)"], "nothing could be of the class"),
        (["assert", "below(thing, autonomous)"], "cannot be below"),
        (["assert", "thing"], "assert disjoint"),
        (["disable", "Nothing"], "no defined class"),
        (["add", "A", "x < 3", "--of-things", "--forbid"], "only classes of scenes"),
        (["list", "--export", "words.txt"], "exported as"),
        (["remove"], "remove"),
    ],
)
def test_what_is_refused_changes_nothing(tracked_run, call, words, said):
    told = call("knowledge", tracked_run, *words)
    assert told.status == 2 and said in told.message
    assert not (tracked_run / "knowledge.jsonl").exists()


def test_a_learned_class_that_is_gone_may_have_been_switched_off(run, call):
    (run / "knowledge.jsonl").write_text('{"do": "disable", "name": "Gone"}\n')
    call("knowledge", run, "add", "High", "thing.y < 40", "--forbid")
    assert set(classes(call, run)) >= {"High"} and "Gone" not in classes(call, run)
    assert call("eval", run, "--episodes", "1", "--max-decisions", "5").status == 0
    assert "no defined class" in call("knowledge", run, "disable", "Gone").message


@pytest.mark.parametrize(
    "line",
    [b'{"do": "add"', b'{"do": "add", "name": 5}', b'{"do": "add", "name": "\xff"}', b'{"do": "add", "of": 1}', b"7"],
)
def test_a_damaged_log_is_told(run, call, line):
    (run / "knowledge.jsonl").write_bytes(line + b"\n")
    told = call("knowledge", run)
    assert told.status == 1 and "damaged in line 1" in told.message


def test_a_class_that_people_added_can_be_a_goal(run, call):
    call("knowledge", run, "add", "Wanted", "thing")
    assert call("play", run, "--goal", "Wanted").status == 0


@pytest.mark.parametrize("suffix", [".ttl", ".owl"])
def test_the_export_can_be_read(run, call, tmp_path, suffix):
    call("knowledge", run, "add", "Upper", "thing.y < 40 or count(thing) >= 2", "--comment", "In the upper part.")
    path = tmp_path / f"words{suffix}"
    assert call("knowledge", run, "--export", path).status == 0
    form = ox.RdfFormat.TURTLE if suffix == ".ttl" else ox.RdfFormat.RDF_XML
    triples = {(str(t.subject), str(t.predicate), str(t.object)) for t in ox.parse(path.read_bytes(), form)}
    base = load_knowledge(run).base
    told = [o for s, p, o in triples if s == f"<{base}Upper>" and p.endswith("comment>")]
    assert told == ['"In the upper part."']
    assert (f"<{base}autonomous>", "<http://www.w3.org/2000/01/rdf-schema#subClassOf>", f"<{base}thing>") in triples


def test_the_export_in_manchester_syntax_says_the_same(run, call, tmp_path):
    call("knowledge", run, "add", "Upper", "thing.y < 40 or count(thing) >= 2", "--comment", 'In the "upper" part.')
    path = tmp_path / "words.omn"
    assert call("knowledge", run, "--export", path).status == 0
    known = load_knowledge(run)
    words, text = known.now.words, path.read_text()
    assert f"Prefix: : <{known.base}>" in text and 'rdfs:comment "In the \\"upper\\" part."' in text
    told = dict(re.findall(r"^Class: (\w+)\n.*\n    EquivalentTo: (.*)$", text, re.MULTILINE))
    assert set(told) == set(words.definitions)
    for name, definition in words.definitions.items():
        assert read_manchester(told[name], words) == definition.expression
    frames = re.findall(r"^(Class|ObjectProperty|DataProperty|Individual): (\w+)$", text, re.MULTILINE)
    assert {name for kind, name in frames if kind == "Class"} == set(words.class_names)
    assert [name for kind, name in frames if kind == "ObjectProperty"] == list(words.role_names)
    assert [name for kind, name in frames if kind == "DataProperty"] == list(words.numbers)
    assert [name for kind, name in frames if kind == "Individual"] == list(words.individuals)
    assert "    SubClassOf: thing" in text and "DisjointClasses: thing, border" in text


@pytest.mark.parametrize("policy", ["goal", "planner", "agent"])
def test_playing_for_a_goal_keeps_out_of_what_is_forbidden(run, call, policy):
    call("knowledge", run, "add", "High", "thing.y < 101", "--forbid")
    lost = json.loads(call("play", run, "--goal", "thing", "--policy", policy, "--json").out)
    assert lost["reached"] == 0  # it is there at once, and nowhere else to go
    assert call("knowledge", run, "disable", "High").status == 0
    assert json.loads(call("play", run, "--goal", "thing", "--policy", policy, "--json").out)["reached"] == 1


def test_a_goal_that_is_forbidden_is_refused_before_play(run, call):
    call("knowledge", run, "add", "High", "thing.y < 40", "--forbid")
    told = call("play", run, "--goal", "thing.y < 30 and High")
    assert told.status == 2 and "contradicts itself" in told.message


def test_play_is_shielded_from_what_is_forbidden(run, call):
    player = load_player(run)
    assert shielded(player, run) is player
    call("knowledge", run, "add", "High", "thing.y < 40", "--forbid")
    guarded = shielded(load_player(run), run)
    assert guarded.shield is not None and isinstance(guarded.planning.planner, GoalPlanner)
    for policy in ("agent", "planner"):
        assert evaluate(run, episodes=1, policy=policy, max_decisions=20).episodes == 1
    call("knowledge", run, "disable", "High")
    assert shielded(load_player(run), run).shield is None


@pytest.mark.parametrize("mode", ["on", "shuffled"])
def test_classes_count_in_plans_where_they_are_asked_to(run, mode):
    told = evaluate(run, episodes=1, policy="planner", classes=mode, max_decisions=20)
    assert told.conditions["classes"] == mode and 0 <= told.conditions["changed"] <= 1
    assert (run / f"evaluation-planner-classes-{mode}.json").exists()


def test_what_is_disabled_does_not_count(run, call):
    for name in [name for name, one in classes(call, run).items() if one["origin"] == "learned"]:
        assert call("knowledge", run, "disable", name).status == 0
    told = call("eval", run, "--policy", "planner", "--episodes", 1, "--classes", "on")
    assert told.status == 2 and "knows no class" in told.message


def test_only_three_ways_to_count_classes_are_known(tracked_run):
    with pytest.raises(UsageError, match=r"off, on, shuffled"):
        evaluate(tracked_run, episodes=1, classes="maybe")


def test_an_explanation_is_of_the_game_that_is_shielded(run, call):
    call("knowledge", run, "add", "High", "thing.y < 40", "--forbid")
    done = []
    evaluate(run, episodes=1, max_decisions=12, on_step=lambda _episode, step: done.append(step.action))
    names = load_player(run).action_names
    for step in (3, 9):
        assert explain(run, episode=0, step=step).choice.action == names[done[step + 1]]


def test_a_rule_that_is_switched_off_counts_for_nothing_until_it_is_on_again(run, call):
    def rules():
        return {one["name"]: one for one in json.loads(call("knowledge", run, "--json").out)["rules"]}

    def imagined():
        player = shielded(load_player(run, memory=True), run)
        step = next(player.episode(0, 0))
        sequences = np.zeros((1, 12), np.int64) + np.arange(len(player.action_names))[:, None]
        return player.planning.world_model.imagine(step.record.history, sequences).states

    before, known = imagined(), rules()
    printed = json.loads(call("rules", run, "--trees", "--json").out)["rules"]
    assert set(known) == {one["name"] for one in printed} and all(one["enabled"] for one in known.values())
    write_log(run, [Edit(do="disable", name=name) for name, one in known.items() if "the re" not in one["about"]])
    assert not np.array_equal(imagined(), before)
    write_log(run, [])
    name = next(iter(known))
    assert call("knowledge", run, "disable", name).status == 0
    assert not rules()[name]["enabled"] and f"  {name}  " in call("knowledge", run).out
    assert call("knowledge", run, "undo").status == 0
    assert np.array_equal(imagined(), before)
    assert "there is no defined class or rule 'r0'" in call("knowledge", run, "disable", "r0").message
