"""What the page is sent: of a session once, and of every moment that is shown."""

import math
from dataclasses import asdict
from typing import Any

import cv2
import numpy as np

from semrl import __version__
from semrl.core import IMAGE_SIZE_PX, Frame, Plan, Sight
from semrl.evaluation.rules import learned_of, unit_of
from semrl.evaluation.sight import CLASS_COLOURS
from semrl.evaluation.video import imagined_ways
from semrl.knowledge.edits import standing
from semrl.training.loop import Step
from semrl.watch.drawn_map import drawn_map
from semrl.watch.session import WatchSession
from semrl.watch.teaching import describe_edit
from semrl.world_model.rules import sentence

SCENARIOS_SHOWN = 4
FACTS_SHOWN = 60
TRAIL_DECISIONS = 24
"""For so many decisions the page shows where things came from, and what came."""
EDITS_SHOWN = 12
LARGEST_PNG_PX = 320 * 240
"""Larger frames go as JPEG."""


def about(session: WatchSession) -> dict[str, Any]:
    """Return what stays as it is while a session lasts: who plays what, by which keys, and what was learned before."""
    player = session.player
    planning = player.planning
    can_predict = planning is not None and len(planning.state_map.graph_) > 0 and planning.world_model.is_fitted
    return {
        "type": "about",
        "version": __version__,
        "run": session.run,
        "env": player.config.env,
        "model": player.config.model,
        "decisions": player.decisions,
        "seed": session.seed,
        "actions": list(player.action_names),
        "keys": [sorted(keys) for keys in session.keys],
        "policies": ["agent", "planner"] if can_predict else ["agent"],
        "unit": player.encoder.space.unit,
        "colours": [list(colour) for colour in CLASS_COLOURS],
        "map": drawn_map(planning.state_map.graph_, planning.routes.goals) if planning else None,
        "words": _words(session),
        "learned": [asdict(one) for one in learned_of(player)],
    }


def of_moment(session: WatchSession) -> dict[str, Any]:
    """Return what is shown of a moment, all of it of what JSON knows."""
    moment, player = session.moment, session.player
    step = moment.step
    oldest, newest = session.kept
    names = player.action_names
    return {
        "type": "moment",
        "number": moment.number,
        "oldest": oldest,
        "newest": newest,
        "episode": moment.episode,
        "decision": step.number,
        "action": None if step.action is None else names[step.action],
        "by": moment.by,
        "reward": step.reward,
        "return": step.total,
        "over": step.done,
        "person": session.person,
        "policy": session.policy,
        "objects": _boxed(moment.sight),
        "facts": _facts(session),
        "values": _values(session),
        "plan": _plan(session),
        "ways": [np.round(way, 4).tolist() for way in imagined_ways(player.encoder.space, step)],
        "trail": _trail(session),
        "came": _came(session),
        "rules": _rules(session),
        "place": _place(session, step),
        "goal": None if moment.pursuit is None else asdict(moment.pursuit),
        "taught": _taught(session),
    }


def picture(frame: Frame) -> bytes:
    """Return a frame as PNG, large ones as JPEG."""
    kind = ".png" if frame.shape[0] * frame.shape[1] <= LARGEST_PNG_PX else ".jpg"
    _, encoded = cv2.imencode(kind, frame[..., ::-1])
    return encoded.tobytes()


def objects_between(session: WatchSession, share: float) -> list[dict[str, Any]]:
    """Tell the objects of what is shown as they were on their way there from the decision before, 0 … 1 of it."""
    before, now = _boxed(session.before(1)[0].sight), _boxed(session.moment.sight)
    came = {_track(one): one["box"] for one in before}
    return [
        one
        if (start := came.get(_track(one))) is None
        else {**one, "box": [round(a + share * (b - a), 4) for a, b in zip(start, one["box"], strict=True)]}
        for one in now
    ]


def _track(entry: dict[str, Any]) -> str:
    """Return what an object is called, without the kind that it looks like."""
    return str(entry["name"]).partition(":")[0] or f"of kind {entry['kind']}"


def _boxed(sight: Sight) -> list[dict[str, Any]]:
    """Tell boxes as shares of the frame: left, top, width, height."""
    boxes = np.round(sight.boxes_px[:, [1, 0, 3, 2]] / IMAGE_SIZE_PX, 4).tolist()
    kinds = sight.classes.tolist() or [None] * len(boxes)
    names = sight.names or ("",) * len(boxes)
    return [{"box": box, "kind": kind, "name": name} for box, kind, name in zip(boxes, kinds, names, strict=True)]


def _facts(session: WatchSession) -> list[dict[str, Any]]:
    """Tell the named numbers of the state and their last change, in the unit of the rules.

    Of numbers that are no place, 0 and 1 are written as false and true.
    """
    step, unit, space = session.moment.step, unit_of(session.player), session.player.encoder.space
    names = space.names[:FACTS_SHOWN]
    if step.state is None or not names:
        return []
    holds = (space.axes[: len(names)] < 0) if space.axes is not None else np.zeros(len(names), np.bool_)
    now = step.state.facts[: len(names)]
    before = session.before(1)[0].step.state
    last = now if before is None else before.facts[: len(names)]
    return [
        {
            "name": name,
            "value": bool(value) if flag and value in (0, 1) else _rounded(value / unit),
            "change": 0 if flag else _rounded((value - old) / unit),
        }
        for name, value, old, flag in zip(names, now.tolist(), last.tolist(), holds.tolist(), strict=True)
    ]


def _values(session: WatchSession) -> dict[str, Any] | None:
    shown = session.moment.step.shown
    if shown is None:
        return None
    values = session.player.agent.action_values(shown)
    return {"of": [_rounded(value) for value in values.tolist()], "best": int(values.argmax())}


def _plan(session: WatchSession) -> dict[str, Any] | None:
    """Tell the best scenarios, of equal ones the first, and why the first is the first."""
    record = session.moment.step.record
    if record is None or record.plan is None:
        return None
    plan, names = record.plan, session.player.action_names
    _, different = np.unique(plan.scenarios.actions, axis=0, return_index=True)
    return {
        "scenarios": [_scenario(plan, i, names) for i in np.sort(different)[:SCENARIOS_SHOWN].tolist()],
        "compared": len(plan.scenarios),
        "reason": session.teaching.reason(plan, session.moment.pursuit),
    }


def _scenario(plan: Plan, i: int, names: tuple[str, ...]) -> dict[str, Any]:
    uncertainties = plan.scenarios.uncertainties
    return {
        "actions": [names[action] for action in plan.scenarios.actions[i].tolist()],
        "rewards": [_rounded(reward) for reward in plan.scenarios.rewards[i].tolist()],
        "return": _rounded(float(plan.returns[i])),
        "uncertainty": None if uncertainties is None else _rounded(float(uncertainties[i])),
    }


def _trail(session: WatchSession) -> list[list[list[float]]]:
    """Tell the ways by which the objects came here, as shares of the frame, the oldest place first."""
    space = session.player.encoder.space
    states = [m.step.state.facts for m in session.before(TRAIL_DECISIONS) if m.step.state is not None]
    if space.axes is None or not space.names or not states:
        return []
    facts = np.round(np.stack(states), 4)
    firsts = np.flatnonzero(space.axes[:-1] == 0)[: len(space.names)]
    ways = [facts[:, x : x + 2] for x in firsts.tolist() if space.axes[x + 1] == 1]
    return [way.tolist() for way in ways if np.ptp(way, axis=0).any()]


def _came(session: WatchSession) -> dict[str, Any]:
    """Tell the last decisions, and how far from what was imagined one decision before this state is."""
    trail = session.before(TRAIL_DECISIONS)
    names = session.player.action_names
    decisions = [
        {
            "decision": m.step.number,
            "action": None if m.step.action is None else names[m.step.action],
            "by": m.by,
            "reward": m.step.reward,
        }
        for m in trail[1:]
    ]
    return {"decisions": decisions, "miss": _miss(session)}


def _miss(session: WatchSession) -> float | None:
    """Return by how much the number that was predicted worst differs; None where just this was not imagined."""
    steps = [m.step for m in session.before(1)]
    if len(steps) < 2 or steps[0].record is None or steps[0].record.plan is None or steps[1].state is None:
        return None
    scenarios = steps[0].record.plan.scenarios
    same = np.flatnonzero(scenarios.actions[:, 0] == steps[1].action)
    if not len(same):
        return None
    apart = np.abs(scenarios.states[same[0], 0] - steps[1].state.facts)
    return _rounded(float(apart.max()) / unit_of(session.player))


def _rules(session: WatchSession) -> list[dict[str, Any]]:
    """Tell the rules that held for the decision that led here."""
    steps = [m.step for m in session.before(1)]
    if session.rules is None or len(steps) < 2 or steps[0].record is None or steps[1].action is None:
        return []
    fired = session.rules.fired(steps[0].record.history, steps[1].action)
    off = session.teaching.known.disabled if session.teaching.known else ()
    return [
        {"name": rule.key, "about": rule.about, "says": sentence(rule), "on": rule.key not in off} for rule in fired
    ]


def _place(session: WatchSession, step: Step) -> dict[str, Any] | None:
    """Tell where on the map the state lies, by positions in its graph, and the way to the nearest gain."""
    planning = session.player.planning
    if planning is None or step.record is None or step.record.plan is None or step.record.plan.node < 0:
        return None
    plan = step.record.plan
    routes = session.teaching.routes
    distance = float((planning.routes if routes is None else routes).distances[plan.node])
    return {
        "to": "gain" if routes is None else "goal",
        "node": plan.node,
        "path": plan.path.tolist(),
        "end": int(plan.end_nodes[0]),
        "cost": distance if math.isfinite(distance) else None,
    }


def _words(session: WatchSession) -> dict[str, Any]:
    """Tell what goals and classes may be written of, with an example; or why there is nothing to say."""
    words = session.teaching.words
    if words is None:
        return {"trouble": session.teaching.trouble}
    known = words.words
    ranges = {f"{name}.{number}": bounds for (name, number), bounds in known.ranges.items() if number in ("x", "y")}
    lowest = max(ranges, key=lambda name: ranges[name][1] - ranges[name][0], default="")
    low, high = ranges.get(lowest, (0.0, 0.0))
    return {
        "trouble": "",
        "example": f"{lowest} < {(low + high) / 2:.0f}" if lowest else "",
        "classes": list(known.concepts),
        "numbers": list(known.numbers),
        "roles": list(known.role_names),
        "individuals": list(known.individuals),
    }


def _taught(session: WatchSession) -> dict[str, Any]:
    """Return what people have added to the run, what of it holds now, and what the newest of it made of the plan."""
    teaching, names = session.teaching, session.player.action_names
    steps = [m.step for m in session.before(1)]
    left, changed = standing(teaching.log), session.changed
    return {
        "classes": teaching.classes(steps[-1], steps[0]),
        "edits": [describe_edit(edit) for edit in left[-EDITS_SHOWN:]],
        "edits_in_all": len(left),
        "changed": changed
        and {
            "by": changed.by,
            "before": [names[action] for action in changed.before],
            "after": [names[action] for action in changed.after],
        },
    }


def _rounded(value: float) -> float | None:
    """Round a number to what can be read; JSON has no infinities."""
    return float(f"{value:.4g}") if math.isfinite(value) else None
