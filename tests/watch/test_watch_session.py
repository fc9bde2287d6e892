"""What is watched is what is evaluated; going back shows what was; a person's keys are obeyed."""

import contextlib
import json

import cv2
import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.evaluation.explaining import explain
from semrl.evaluation.player import load_player
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.watch import session as sessions
from semrl.watch.keys import action_for, keys_of
from semrl.watch.session import WatchSession
from semrl.watch.snapshot import about, objects_between, of_moment, picture


def of(step):
    return step.number, step.action, step.total, step.observation.frame.tobytes()


@pytest.mark.parametrize("policy", ["agent", "planner"])
def test_it_plays_the_episodes_of_an_evaluation(watched_player, policy):
    seed = watched_player.config.seed + EVALUATION_SEED
    wanted = [[of(step) for step in watched_player.episode(number, seed, policy)] for number in (0, 1)]
    with contextlib.closing(WatchSession(watched_player, "x", policy=policy)) as session:
        seen = [[of(session.moment.step)], []]
        while len(seen[1]) < len(wanted[1]):
            moment = session.step()
            seen[moment.episode].append(of(moment.step))
    assert seen == wanted


def test_back_and_on_again_show_what_was(session):
    seen = [session.moment, *(session.step() for _ in range(12))]
    assert [session.back() for _ in range(12)] == seen[-2::-1]
    assert session.back() is seen[0], "there is nothing before the first"
    assert [session.step() for _ in range(12)] == seen[1:]
    assert session.step().number == 13
    assert session.show(5) is seen[5] and session.show(-3) is seen[0] and session.show(10**9).number == 13


def test_old_moments_go_and_frames_are_not_written_over(session, monkeypatch):
    monkeypatch.setattr(sessions, "MOST_KEPT", 4)
    first = session.moment.step.observation.frame
    pixels = first.copy()
    for _ in range(9):
        session.step()
    assert session.kept == (6, 9)
    assert session.show(0).number == 6
    assert np.array_equal(first, pixels)


def test_a_person_plays_by_keys_and_hands_back(session):
    names = session.player.action_names
    session.person = True
    for action, keys in enumerate(session.keys):
        session.held = keys
        moment = session.step()
        assert (moment.step.action, moment.by) == (action, "person"), names[action]
    session.person = False
    assert session.step().by == "agent"


def test_where_nothing_waits_the_agent_decides_while_no_key_is_held(session):
    session.keys = keys_of(["LEFT", "RIGHT", "UP"])
    session.person = True
    assert session.step().by == "agent"


@pytest.mark.parametrize(
    ("actions", "held", "done"),
    [
        (("RIGHT", "LEFT"), {"ArrowLeft"}, 1),
        (("RIGHT", "LEFT"), set(), None),
        (("NOOP", "FIRE", "UP", "UPRIGHT", "UPRIGHTFIRE"), {"ArrowUp", "ArrowRight"}, 3),
        (("NOOP", "FIRE", "UP", "UPRIGHT", "UPRIGHTFIRE"), {"ArrowUp", "ArrowRight", " ", "x"}, 4),
        (("NOOP", "FIRE", "UP", "UPRIGHT", "UPRIGHTFIRE"), {"ArrowDown"}, 0),
        (("left", "right", "forward", "pickup", "drop", "toggle", "done"), {"p"}, 3),
        (("left", "right", "forward", "pickup", "drop", "toggle", "done"), {"ArrowUp"}, 2),
        (("NOOP", "ATTACK", "MOVE_LEFT", "ATTACK+MOVE_LEFT"), {"ArrowLeft", " "}, 3),
        (("0", "1", "2"), {"2"}, 1),
    ],
)
def test_keys_by_the_words_of_names(actions, held, done):
    assert action_for(held, keys_of(actions)) == done


@pytest.mark.parametrize("names", [["UP", "GO UP", "UP AGAIN"], [f"odd {i}" for i in range(40)], ["NOOP", "WAIT"]])
def test_no_two_actions_share_their_keys_while_there_are_keys(names):
    keys = [tuple(sorted(wanted)) for wanted in keys_of(names)]
    reachable = [wanted for wanted in keys if wanted != ("",)]
    assert len(set(reachable)) == len(reachable) >= min(len(names), 20)


def test_the_explanation_is_that_of_explain(session, tracked_run):
    for _ in range(9):
        session.step()
    session.show(3)
    ours = session.explain().to_json()
    theirs = explain(tracked_run, episode=0, step=3).to_json()
    assert ours | {"run": ""} == theirs | {"run": ""}


def test_the_newest_decision_is_taken_before_it_is_explained(session):
    number = session.moment.number
    explained = session.explain()
    assert session.moment.number == number and session.kept[1] == number + 1
    session.step()
    assert explained.choice.action == session.player.action_names[session.moment.step.action]


def test_a_persons_decision_is_not_explained(session):
    session.person, session.held = True, session.keys[0] or session.keys[1]
    session.step()
    session.back()
    with pytest.raises(UsageError, match="a person took"):
        session.explain()


def test_who_cannot_plan_cannot_be_asked_to(semantic_run):
    with contextlib.closing(WatchSession(load_player(semantic_run), "x")) as session:
        for ask in (lambda: session.decide_by("planner"), session.explain):
            with pytest.raises(UsageError, match="has no map"):
                ask()
        assert session.policy == "agent" and about(session)["map"] is None
        assert of_moment(session)["plan"] is None


@pytest.mark.parametrize("wrong", [{"seed": -1}, {"episode": -1}])
def test_numbers_below_zero_are_refused(watched_player, wrong):
    with pytest.raises(UsageError, match="0 or more"):
        WatchSession(watched_player, "x", **wrong)


def test_the_snapshot_says_what_the_step_holds(session):
    for _ in range(6):
        session.step()
    told, step = json.loads(json.dumps(of_moment(session), allow_nan=False)), session.moment.step
    player = session.player
    assert (told["decision"], told["return"], told["over"]) == (step.number, step.total, step.done)
    assert told["action"] == player.action_names[step.action]
    assert told["values"]["best"] == player.agent.best_action(step.shown)
    assert told["plan"]["scenarios"][0]["actions"] == [player.action_names[a] for a in step.record.plan.actions]
    assert told["place"]["node"] == step.record.plan.node
    unit = player.encoder.space.unit
    facts = {f["name"]: f["value"] * (1 if isinstance(f["value"], bool) else unit) for f in told["facts"]}
    assert all(isinstance(f["value"], bool) == f["name"].endswith(" seen") for f in told["facts"])
    assert facts == pytest.approx(
        dict(zip(player.encoder.space.names, step.state.facts.tolist(), strict=False)), rel=1e-3, abs=1e-6
    )
    for way in told["ways"]:
        assert len(way) == len(step.record.plan.actions) + 1
    assert [d["decision"] for d in told["came"]["decisions"]] == [1, 2, 3, 4, 5, 6]
    assert len(told["objects"]) == len(session.moment.sight.boxes_px)


def test_the_map_is_drawn_within_its_square(session):
    drawn, graph = about(session)["map"], session.player.planning.state_map.graph_
    assert len(drawn["node"]) == len(graph) == drawn["nodes_in_all"]
    for axis in "xy":
        assert all(0 <= place <= 1 for place in drawn[axis])
    joined = {(int(a), int(b)) for a, b in zip(graph.sources, graph.targets, strict=True) if a != b}
    assert {tuple(edge) for edge in drawn["edges"]} == joined


@pytest.mark.parametrize("size", [(210, 160), (480, 640)])
def test_pictures_show_the_frame(size):
    frame = np.zeros((*size, 3), np.uint8)
    frame[: size[0] // 2] = (200, 30, 60)
    read = cv2.imdecode(np.frombuffer(picture(frame), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert np.abs(read.astype(int) - frame).mean() < 2


def test_a_moment_is_filmed(session, tmp_path):
    for _ in range(8):
        session.step()
    session.write_video(tmp_path / "x.gif", 100)
    assert (tmp_path / "x.gif").read_bytes().startswith(b"GIF89a")


def test_boxes_between_two_moments_are_on_their_way(session):
    moved = 0
    for _ in range(12):
        before = {one["name"].partition(":")[0]: one["box"] for one in of_moment(session)["objects"]}
        session.step()
        now = of_moment(session)["objects"]
        half, end = objects_between(session, 0.5), objects_between(session, 1.0)
        assert np.allclose([one["box"] for one in end], [one["box"] for one in now])
        for one, middle in zip(now, half, strict=True):
            start = before.get(one["name"].partition(":")[0], one["box"])
            assert middle["box"] == pytest.approx(
                [(a + b) / 2 for a, b in zip(start, one["box"], strict=True)], abs=1e-4
            )
            moved += start != one["box"]
        assert len(session.frames_between) == 3
    assert moved
    session.back()
    assert session.frames_between == []
