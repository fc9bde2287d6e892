"""Lists are compared with what came and with what a world model predicted; what befalls steered things is a rule."""

import numpy as np
import pytest
from rallies import BALL, rally, rules_of, table, thing, trajectory_of
from roads import road

from semrl.core import Trajectory
from semrl.world_model.lifted.checking import PredictedEpisode
from semrl.world_model.rules import sentence


@pytest.fixture(scope="module")
def rallies():
    return rules_of(trajectory_of(*rally(1000, seed)) for seed in range(3))


def ahead(trajectory, *, frozen):
    """What a world model that knows everything, or one that lets nothing move, predicts."""
    last = len(trajectory)
    places = np.minimum(np.arange(last)[:, None] + (0 if frozen else np.array([1, 2])), last) + np.zeros((1, 2), int)
    rewards = np.append(trajectory.rewards, 0)[np.stack([np.arange(last), np.arange(last) + 1], axis=1)]
    return PredictedEpisode(trajectory=trajectory, states=trajectory.states[places], rewards=rewards * (not frozen))


def by_about(rules, names, checks):
    found = rules.rules(names, most=100)
    firsts = np.cumsum([0, *(check.rules for check in checks)])
    return {(check.about, found[first].claim): check for check, first in zip(checks, firsts, strict=False)}


def test_a_list_is_compared_with_what_came_and_with_what_was_predicted(rallies):
    fresh = trajectory_of(*rally(600, 7))
    knowing = rallies.check([ahead(fresh, frozen=False)])
    resting = rallies.check([ahead(fresh, frozen=True)])
    assert sum(check.rules for check in knowing) == len(rallies.rules(["UP", "DOWN"], most=100))
    turns = [check for check in knowing if check.about.endswith("vx") or check.about == "the reward"]
    assert len(turns) >= 2
    for check in turns:
        assert 0.95 * check.decisions <= check.right <= check.decisions == check.world_model_right
        assert check.agreed == check.right and check.world_model_right_of_came == check.came >= 3
        assert check.right_of_came >= 0.7 * check.came
    for check in resting:
        if check.about == "the reward":
            assert check.world_model_right_of_came == 0 and check.agreed < check.decisions
            assert check.right == next(one.right for one in knowing if one.about == check.about)
    assert "agrees with the world model in 100 of 100" in str(turns[0])


def test_things_that_share_a_slot_have_no_prediction_but_the_one_that_is_listed(rallies):
    fresh = trajectory_of(*rally(300, 8))
    away = Trajectory(states=fresh.states + 0.5, actions=fresh.actions, rewards=fresh.rewards, things=fresh.things)
    by_place = rallies.check([ahead(away, frozen=False)])
    assert all(check.decisions == 0 for check in by_place if check.about.endswith(("vx", "vy")))
    assert "nothing" in str(by_place[-1])


def told(rules, *names):
    return [f"{rule.about}: {sentence(rule)}" for rule in rules.rules(names, most=100)], rules.rules(names, most=100)


def test_what_stops_a_steered_thing_is_a_rule(rallies):
    lines, rules = told(rallies, "UP", "DOWN")
    stops = {rule.conditions: rule for rule in rules if rule.claim.startswith("vy is 0 whatever the action")}
    stop = stops["it is beyond its top edge next",]
    assert stop.right > 0.8 * stop.decisions > 20, lines


def test_what_sets_a_steered_thing_back_is_a_rule():
    lines, rules = told(rules_of(road(900, seed) for seed in range(3)), "DOWN", "UP")
    top, contact, otherwise = [rule for rule in rules if rule.claim.startswith("it goes down whatever the action")]
    assert top.conditions == ("it is beyond its top edge next",) and top.right == top.decisions > 30
    assert contact.conditions[0].startswith("it touches concept") and contact.right > 0.35 * contact.decisions > 10, (
        lines
    )
    assert otherwise.conditions == ("otherwise",) and otherwise.right < 0.01 * otherwise.decisions


@pytest.mark.parametrize("swaps", [False, True])
def test_what_goes_on_for_ever_does_not_turn(swaps):
    lines, rules = told(rules_of(road(900, seed, swaps=swaps) for seed in range(3)), "DOWN", "UP")
    assert not [rule for rule in rules if ":= −" in rule.claim or "turns" in rule.claim], lines


def test_what_turns_amid_a_decision_is_mirrored_all_the_same():
    tables, y, vy = [], 30.3, 3.7
    for _ in range(1500):
        tables.append(table(thing(0, BALL, (30, y, 32, y + 2), slot=0)))
        y += vy
        if not 10 <= y <= 70:
            y, vy = 2 * (10 if y < 10 else 70) - y, -vy
    seen = trajectory_of(tables, np.arange(1500) % 2, np.zeros(1500, np.float32))
    lines, rules = told(rules_of([seen]), "A", "B")
    top, bottom, otherwise = [rule for rule in rules if rule.claim == "vy := −vy"]
    assert {top.conditions, bottom.conditions} == {
        ("it is beyond its top edge next",),
        ("it is beyond its bottom edge next",),
    }
    assert min(rule.right / rule.decisions for rule in (top, bottom)) > 0.95 and min(top.right, bottom.right) > 35, (
        lines
    )
    assert otherwise.right <= 0.01 * otherwise.decisions
