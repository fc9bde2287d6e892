"""Rules that fire are those of `semrl rules`, one of each number, and their conditions hold."""

import re

from semrl.evaluation.rules import rules_of, unit_of
from semrl.watch.snapshot import of_moment
from semrl.world_model.rules import sentence


def test_one_rule_of_each_number_fires_and_holds(session):
    player = session.player
    known = {(rule.about, sentence(rule)) for rule in rules_of(player)}
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
