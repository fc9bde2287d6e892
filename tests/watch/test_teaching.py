"""A goal that is typed is pursued, an edit changes the next plan and can be taken back; what is refused is said."""

import contextlib
import json
import shutil

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.evaluation import evaluate
from semrl.evaluation.goals import play_for_goal
from semrl.evaluation.knowledge import load_knowledge
from semrl.evaluation.player import load_player
from semrl.knowledge.edits import Edit, read_log
from semrl.planning.goal_planner import GoalPlanner
from semrl.watch.session import WatchSession
from semrl.watch.snapshot import about, of_moment
from semrl.watch.teaching import edit_of

HIGH = {"class": "High", "is": "thing.y < 60", "forbidden": True}


@pytest.fixture
def folder(tracked_run, tmp_path):
    """A copy of a run, whose knowledge may be edited."""
    shutil.copytree(tracked_run, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def session(folder):
    with contextlib.closing(WatchSession(load_player(folder, memory=True), "taught", folder=folder)) as session:
        yield session


def known(session):
    return {one["name"]: one for one in of_moment(session)["taught"]["classes"]}


def walk(session, most=300):
    """Step until the goal came to its end; return how it did."""
    for _ in range(most):
        pursuit = session.step().pursuit
        if pursuit.state != "sought":
            return pursuit
    return pursuit


@pytest.mark.parametrize(
    "goal", ["thing.x < 45", "contains some (thing and y some xsd:double[> 60.0])", "always(true)"]
)
def test_it_is_pursued_as_play_does(folder, session, goal):
    session.seek(goal)
    assert session.policy == "planner" and isinstance(session.player.planning.planner, GoalPlanner)
    first = session.moment.pursuit
    assert (first.goal, first.state, first.decisions) == (goal, "sought", 0)
    pursuit = walk(session)
    # the first trial of `semrl play` and the first episode of an evaluation are the same game
    wanted = play_for_goal(folder, goal, trials=1, max_decisions=session.moment.step.number).decisions
    assert [pursuit.decisions if pursuit.state == "reached" else None] == wanted
    assert pursuit.done == (pursuit.state == "reached")


def test_what_is_reached_hands_back_and_what_is_lost_is_sought_anew(session):
    session.seek("thing")
    assert walk(session).state == "reached" and session.policy == "agent"
    assert not isinstance(session.player.planning.planner, GoalPlanner)
    session.seek("always(ball.y < 50)")  # it falls
    while session.step().pursuit.state == "sought":
        pass
    assert session.moment.pursuit.state == "lost" and session.policy == "planner"
    session.new_episode()
    assert (session.moment.pursuit.state, session.moment.pursuit.decisions) == ("sought", 0)
    session.seek(None)
    assert session.moment.pursuit is None and session.policy == "agent"


def test_a_goal_in_what_is_forbidden_cannot_be_had(session):
    session.edit(edit_of(HIGH))
    with pytest.raises(UsageError, match="contradicts itself"):
        session.seek("thing.y < 50")
    session.edit(edit_of({"class": "High", "on": False}))
    session.seek("thing.y < 50")
    assert session.moment.pursuit.state == "sought"


def test_the_reason_is_the_goal_or_what_is_forbidden_also_on_the_page(session):
    session.edit(edit_of(HIGH))
    assert "forbidden" in of_moment(session)["plan"]["reason"] and "forbidden" in session.explain().reason
    session.edit(edit_of({"undo": True}))
    assert "forbidden" not in of_moment(session)["plan"]["reason"]
    session.seek("always(true)")
    assert "goal" in of_moment(session)["plan"]["reason"] and "goal" in session.explain().reason


def test_the_moment_goes_back_with_its_goal(session):
    session.step()
    session.seek("always(true)")
    told = [session.moment.pursuit, *(session.step().pursuit for _ in range(3))]
    assert [pursuit.decisions for pursuit in told] == [0, 1, 2, 3]
    assert [session.back().pursuit for _ in range(4)] == [*told[2::-1], None]


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("thing and not thing", "contradicts itself"),
        ("thing.x < -50", "cannot be had"),
        ("bal", "there is no class 'bal'"),
        ("thing.x <", "malformed"),
        ("contains some", "ends where"),
    ],
)
def test_what_cannot_be_had_is_said_and_changes_nothing(session, goal, said):
    with pytest.raises(UsageError, match=said):
        session.seek(goal)
    assert session.moment.pursuit is None and session.policy == "agent"


def test_a_forbidden_class_changes_the_next_plan_and_play_is_that_of_eval(folder, session):
    session.decide_by("planner")
    plain = session.moment.step.record.plan
    session.edit(edit_of(HIGH))
    guarded = session.moment.step.record.plan
    assert isinstance(session.player.planning.planner, GoalPlanner)

    def entered(plan):  # how often the best scenario has a thing above 60
        places = session.teaching.words.reader.slots
        ys = [slot.columns["y"] for slot in places if "y" in slot.columns]
        seen = [slot.columns["seen"] for slot in places if "y" in slot.columns]
        unit = session.player.encoder.space.unit
        states = plan.scenarios.states[0]
        return int(((states[:, ys] / unit < 60) & (states[:, seen] > 0.5)).any(axis=1).sum())

    assert entered(guarded) <= entered(plain)
    assert session.changed.before == tuple(plain.actions) and session.changed.after == tuple(guarded.actions)
    wanted = evaluate(folder, episodes=1, policy="planner").returns[0]
    while not session.step().step.done:
        pass
    assert session.moment.step.total == wanted
    session.edit(edit_of({"class": "High", "on": False}))
    assert not isinstance(session.player.planning.planner, GoalPlanner)


def test_the_action_that_is_taken_is_that_of_the_new_plan(session):
    session.decide_by("planner")
    for _ in range(3):
        session.step()
    session.edit(edit_of(HIGH))
    wanted = int(session.moment.step.record.plan.actions[0])
    assert session.step().step.action == wanted


def test_the_record_is_that_of_semrl_knowledge(folder, session):
    session.edit(edit_of(HIGH))
    session.edit(edit_of({"class": "Both", "is": "High and count(thing) > 1"}))
    session.edit(edit_of({"class": "High", "on": False}))
    assert [edit.do for edit in read_log(folder)] == ["add", "add", "disable"]
    wanted = load_knowledge(folder).to_dict()["classes"]
    told = of_moment(session)["taught"]
    assert [(one["name"], one["condition"], one["on"], one["forbidden"]) for one in told["classes"]] == [
        (one["name"], one["condition"], one["enabled"], one["forbidden"]) for one in wanted
    ]
    assert told["edits"] == [
        "forbidden class High: thing.y < 60",
        "class Both: High and count(thing) > 1",
        "High switched off",
    ]
    for left in (2, 1, 0):
        session.edit(edit_of({"undo": True}))
        assert of_moment(session)["taught"]["edits_in_all"] == left
    with pytest.raises(UsageError, match="no edit"):
        session.edit(edit_of({"undo": True}))
    assert "High" not in known(session) and not any(edit["on"] is False for edit in known(session).values())


def test_classes_hold_where_their_conditions_do(session):
    session.edit(edit_of({"class": "Left", "is": "x < 50", "of_things": True}))
    session.edit(edit_of({"class": "Some", "is": "some(contains, Left)"}))
    names, unit = session.player.encoder.space.names, session.player.encoder.space.unit
    kinds = set()
    for _ in range(20):
        told = known(session)
        facts = dict(zip(names, (session.moment.step.state.facts / unit).tolist(), strict=False))
        slots = session.teaching.words.reader.slots
        at = [(slot.name, facts[names[slot.columns["x"]]], facts[names[slot.columns["seen"]]]) for slot in slots]
        left = [name for name, x, seen in at if x < 50 and seen * unit > 0.5]
        assert told["Left"]["holds"] == left and told["Some"]["holds"] == bool(left)
        kinds.add(bool(left))
        session.step()
    assert kinds


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({"class": "Own Class", "is": "thing"}, "made of letters"),
        ({"class": "Empty", "is": "thing and not thing"}, "nothing could be of the class Empty"),
        ({"class": "A", "is": "x < 3", "of_things": True, "forbidden": True}, "only classes of scenes"),
        ({"class": "Nothing", "on": True}, "no defined class"),
        ({"fact": "disjoint(thing, autonomous)"}, "nothing could be of the class"),
        ({"fact": "thing"}, "assert disjoint"),
        ({"class": 3, "is": "thing"}, "give a class"),
        ({"undo": 1}, "give a class"),
        ("High", "give a class"),
        (None, "give a class"),
    ],
)
def test_what_is_refused_leaves_all_as_it_was(folder, session, value, said):
    plan = session.moment.step.record.plan
    with pytest.raises(UsageError, match=said):
        session.edit(edit_of(value))
    assert session.moment.step.record.plan is plan and not (folder / "knowledge.jsonl").exists()


def test_a_fact_puts_things_into_classes(session):
    words = session.teaching.words.words
    session.edit(edit_of({"class": "Held", "is": "controlled", "of_things": True}))
    before = known(session)["Held"]["holds"]
    assert not any(name.endswith("_border") for name in before)
    with pytest.raises(UsageError, match="nothing could be of the class border"):
        session.edit(edit_of({"fact": "below(border, controlled)"}))  # nothing is both a border and a thing
    slots = [slot.name for slot in session.teaching.words.reader.slots]
    others = [name for name in slots if name in words.concepts and "controlled" not in words.above(name)]
    free = [name for name in others if not any({"autonomous", "controlled"} <= set(group) for group in words.disjoint)]
    for name in free:
        session.edit(edit_of({"fact": f"below({name}, controlled)"}))
        assert name in known(session)["Held"]["holds"]


def test_who_has_no_words_is_told_why(semantic_run):
    with contextlib.closing(WatchSession(load_player(semantic_run), "x", folder=semantic_run)) as session:
        assert "has no map" in about(session)["words"]["trouble"]
        for ask in (lambda: session.seek("thing"), lambda: session.edit(Edit(do="undo"))):
            with pytest.raises(UsageError, match="has no map"):
                ask()
        assert of_moment(session)["goal"] is None and of_moment(session)["taught"]["classes"] == []


def test_what_is_told_is_json(session):
    session.seek("thing.x < 45 and thing.y > 20")
    session.edit(edit_of(HIGH))
    for _ in range(8):
        told = json.loads(json.dumps(of_moment(session), allow_nan=False))
        assert 0 <= told["goal"]["done"] <= 1 and told["place"]["to"] in ("goal", "gain")
        session.step()
    assert set(about(session)["words"]) == {"trouble", "example", "classes", "numbers", "roles", "individuals"}
    session.edit(edit_of({"undo": True}))
    session.seek(about(session)["words"]["example"])
    assert np.isfinite(session.moment.pursuit.done)
