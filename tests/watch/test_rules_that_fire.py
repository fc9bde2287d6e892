"""Rules that fire are those of `semrl rules --trees`, one of each number, and their conditions hold."""

import contextlib
import re
import shutil

import numpy as np

from semrl.evaluation.player import load_player
from semrl.evaluation.rules import tree_rules_of, unit_of
from semrl.watch.session import WatchSession
from semrl.watch.snapshot import of_moment
from semrl.watch.teaching import edit_of
from semrl.world_model.rules import sentence
from semrl.world_model.tree_world import RETURN, REWARD


def test_one_rule_of_each_number_fires_and_holds(session):
    player = session.player
    known = {(rule.about, sentence(rule)) for rule in tree_rules_of(player)}
    names = player.encoder.space.names
    checked = 0
    for _ in range(30):
        before = session.moment.step.state.facts / unit_of(player)
        action = player.action_names[session.step().step.action]
        fired = of_moment(session)["rules"]
        assert {(rule["about"], rule["says"]) for rule in fired} <= known
        assert len(fired) == len({rule["about"] for rule in fired}) > 1
        now = dict(zip(names, before.tolist(), strict=False))
        for rule in fired:
            for condition in re.split(" and |if ", rule["says"]):
                if limits := re.fullmatch(r"(?:(\S+) < )?(.+?) (?:≤ (\S+)|> (\S+))(?:  \(.*)?", condition):
                    low, name, high, above = limits.groups()
                    if name in now:
                        checked += 1
                        assert float(low or above or "-inf") - 1e-2 <= now[name] <= float(high or "inf") + 1e-2
                if meant := re.match(r"the action is (.+?)(?:  \(|$)", condition):
                    checked += 1
                    assert action in meant[1].split(" or ")
    assert checked > 10


def test_a_rule_is_switched_off_and_on_while_one_watches(tracked_run, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(tracked_run, folder)
    with contextlib.closing(WatchSession(load_player(folder, memory=True), "switched", folder=folder)) as session:
        session.decide_by("planner")
        session.step()
        before = session.moment.step.record.plan
        rewarding = (REWARD, RETURN)
        names = [name for name, rule in session.teaching.rules.items() if rule.about in rewarding]
        for name in names:
            session.edit(edit_of({"class": name, "on": False}))
        plan = session.moment.step.record.plan
        assert not plan.scenarios.rewards.any() and not plan.scenarios.values.any()
        assert {rule["about"]: rule["on"] for rule in of_moment(session)["rules"]}[REWARD] is False
        for name in names:
            session.edit(edit_of({"class": name, "on": True}))
        assert np.array_equal(session.moment.step.record.plan.scenarios.states, before.scenarios.states)
        assert all(rule["on"] for rule in of_moment(session)["rules"])
