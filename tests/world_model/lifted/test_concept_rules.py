"""What was seen of things is read as rules of few literals, each with how often it held."""

from dataclasses import replace

import numpy as np
import pytest
from bricks import bricks
from rallies import rally, rules_of, trajectory_of

from semrl.concepts import Concepts
from semrl.core import Trajectory
from semrl.core.errors import UsageError
from semrl.core.things import OWN
from semrl.world_model import ConceptRules
from semrl.world_model.lifted.decision_lists import rewards_told
from semrl.world_model.lifted.events import LATE
from semrl.world_model.rules import sentence


@pytest.fixture(scope="module")
def rallies():
    """Read from three thousand decisions."""
    return rules_of(trajectory_of(*rally(1000, seed)) for seed in range(3))


def test_the_first_dozen_rules_tell_the_laws(rallies):
    """Walls and paddle turn the ball, a miss costs, actions push the paddle; each with how often that was so."""
    found = rallies.rules(["UP", "DOWN"])[:12]
    told = [f"{rule.about}: {sentence(rule)}" for rule in found]

    def first(*parts):
        (place,) = [i for i, line in enumerate(told) if all(part in line for part in parts)][:1] or [-1]
        assert place >= 0, (parts, told)
        return found[place]

    for rule in (
        first("vy := −vy", "beyond its top edge next"),
        first("vy := −vy", "beyond its bottom edge next"),
        first("vx := −vx", "touches own"),
        first("the reward", "-1 by object", "beyond its right edge"),
    ):
        assert 5 <= rule.right <= rule.decisions and rule.right >= 0.4 * rule.decisions
    up, down = first("own", "vy is -3 px, up", "the action is UP"), first("own", "vy is +3 px, down", "action is DOWN")
    assert up.right > 0.8 * up.decisions and down.right > 0.8 * down.decisions
    rare = first("vy := −vy otherwise")
    assert rare.right < 0.1 * rare.decisions


def test_what_holds_for_long_before_a_reward_does_not_tell_it_twice():
    """The ball is at the edge as a point is lost; the enemy was at the bottom for two decisions, and now and then."""
    came = np.array([-LATE, -1, 0, 0, -LATE, -1, 0, np.nan], np.float32)
    ball, enemy = np.array([[0, -1, 0, 0, 0, -1, 0, -1], [-1, -1, -1, 0, -1, -1, 0, 0]], np.float32)
    assert rewards_told(ball, came) == 2.0 > rewards_told(enemy, came) == pytest.approx(1.6)
    assert rewards_told(np.zeros(8, np.float32), came) == 0


def test_actions_that_explain_nothing_are_not_listed():
    """Where everything passes for controlled, the ball does not: it flies the same whatever is done."""

    def all_own(trajectory):
        things = [seen.copy() for seen in trajectory.things]
        for seen in things:
            seen[:, OWN] = 1
        return replace(trajectory, things=tuple(things))

    found = rules_of(all_own(trajectory_of(*rally(1000, seed))) for seed in range(3)).rules(["UP", "DOWN"])
    by_action = {rule.about for rule in found if any("the action is" in said for said in rule.conditions)}
    (paddle,) = by_action
    assert paddle.endswith(" vy")
    (ball,) = {rule.about for rule in found if rule.about.endswith(" vx")}
    assert ball.partition(" ")[0] != paddle.partition(" ")[0]


def test_rules_name_what_is_touched():
    rules = rules_of(trajectory_of(*bricks(600, seed)) for seed in range(3))
    rule, otherwise = [rule for rule in rules.rules(["NOOP"]) if rule.about == "the reward"]
    (brick,) = np.unique(rules.concepts.families_[rules.concepts.is_lost_])
    name = rules.concepts.table_.names[brick]
    assert any("touches" in said and name in said for said in rule.conditions)
    assert rule.claim.startswith("+1") and otherwise.claim.startswith("none")
    assert rule.right / rule.decisions > 10 * (1 - otherwise.right / otherwise.decisions)


def test_a_reader_goes_on_where_it_was_saved(rallies):
    again = ConceptRules(rallies.concepts)
    again.from_arrays(rallies.to_arrays())
    assert again.rules(["UP", "DOWN"]) == rallies.rules(["UP", "DOWN"])
    more = trajectory_of(*rally(300, 9))
    again.partial_fit(more)
    longer = rules_of(trajectory_of(*rally(n, seed)) for seed, n in ((0, 1000), (1, 1000), (2, 1000), (9, 300)))
    assert again.rules(["UP", "DOWN"]) == longer.rules(["UP", "DOWN"]) != rallies.rules(["UP", "DOWN"])


def test_fewer_rules_may_be_asked_for(rallies):
    names = ["UP", "DOWN"]
    assert len(rallies.rules(names, most=1)) < len(rallies.rules(names))
    with pytest.raises(UsageError, match="at least one"):
        rallies.rules(names, most=0)


def test_without_things_there_are_no_rules():
    rules = ConceptRules(Concepts())
    rules.partial_fit(
        Trajectory(states=np.zeros((3, 6), np.float32), actions=np.zeros(2, np.int64), rewards=np.zeros(2, np.float32))
    )
    assert rules.rules(["UP"]) == [] and ConceptRules(Concepts()).rules([]) == []
