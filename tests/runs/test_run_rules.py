"""What a run has learned of its world, read as rules."""

import pytest

from semrl.errors import UsageError
from semrl.ontology.tree_world import RETURN, REWARD
from semrl.runs.rules import load_rules


def test_every_number_of_the_state_and_the_reward_have_rules(ram_map_run):
    found = load_rules(ram_map_run, most=5)
    names = ["player_y", "enemy_y", "ball_x", "ball_y"]
    assert list(dict.fromkeys(rule.about for rule in found)) == [*names, REWARD, RETURN]
    for about in (*names, REWARD):
        mine = [rule for rule in found if rule.about == about]
        assert 1 <= len(mine) <= 5 and len({rule.conditions for rule in mine}) == len(mine)
        counts = [rule.decisions for rule in mine]
        assert counts == sorted(counts, reverse=True)
    assert len({sum(rule.decisions for rule in found if rule.about == about) for about in names}) == 1
    assert any("the action" in condition for rule in found if rule.about == "player_y" for condition in rule.conditions)


def test_networks_have_no_rules_to_read(map_run, semantic_run):
    with pytest.raises(UsageError, match="foresees by networks"):
        load_rules(map_run)
    with pytest.raises(UsageError, match="has no map"):
        load_rules(semantic_run)
