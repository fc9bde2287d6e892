"""What a run has learned of its world, read as rules."""

import pytest

from semrl.core.errors import UsageError
from semrl.evaluation.player import load_player
from semrl.evaluation.rule_check import check_rules
from semrl.evaluation.rules import learned_of, load_rules, with_checks
from semrl.world_model.rules import sentence
from semrl.world_model.tree_world import RETURN, REWARD


def test_every_number_of_the_state_and_the_reward_have_rules(ram_map_run):
    found = load_rules(ram_map_run, most=5)
    by_name = {}
    for rule in found:
        by_name.setdefault(rule.about.removeprefix("the change of "), []).append(rule)
    names = ["player_y", "enemy_y", "ball_x", "ball_y"]
    assert list(by_name) == [*names, REWARD, RETURN]
    for mine in (by_name[name] for name in (*names, REWARD)):
        assert 1 <= len(mine) <= 5 and len({rule.conditions for rule in mine}) == len(mine)
        counts = [rule.decisions for rule in mine]
        assert counts == sorted(counts, reverse=True)
    assert len({sum(rule.decisions for rule in by_name[name]) for name in names}) == 1
    assert any("the action" in condition for rule in by_name["player_y"] for condition in rule.conditions)


def test_where_things_are_followed_rules_are_about_concepts(tracked_run):
    found = load_rules(tracked_run)
    concepts = load_player(tracked_run).planning.concepts.table_.names
    assert found and all(rule.about == REWARD or rule.about.split()[0] in concepts for rule in found)
    assert all(rule.claim and 0 <= rule.right <= rule.decisions for rule in found)
    learned = learned_of(load_player(tracked_run))
    assert [one for about in learned for one in about.says] == [sentence(rule) for rule in found]
    assert all(about.moved for about in learned if about.name in concepts)
    by_trees = load_rules(tracked_run, trees=True)
    assert by_trees and not any(rule.claim for rule in by_trees)


def test_rules_about_concepts_are_checked_in_new_play(tracked_run):
    player = load_player(tracked_run)
    found, checks = load_rules(tracked_run), check_rules(player, decisions=80)
    assert checks == check_rules(load_player(tracked_run), decisions=80)
    assert sum(check.rules for check in checks) == len(
        player.planning.concept_rules.rules(player.action_names, most=99)
    )
    assert any(check.decisions > 20 for check in checks)
    for check in checks:
        parts = check.agreed, check.right, check.world_model_right, check.came
        assert max(parts) <= check.decisions and max(check.right_of_came, check.world_model_right_of_came) <= check.came
    told = learned_of(player, checks)
    shown = [check for _, check in with_checks(found, checks) if check]
    assert 0 < len(shown) <= len(checks)
    assert [one for about in told for one in about.says if one == str(shown[0])]
    assert sum(len(about.says) for about in told) == len(found) + len(shown)


def test_where_nothing_is_followed_there_is_nothing_to_check(ram_map_run, semantic_run):
    assert check_rules(load_player(ram_map_run)) == [] == check_rules(load_player(semantic_run))


def test_networks_have_no_rules_to_read(map_run, semantic_run):
    with pytest.raises(UsageError, match="predicts by 'networks', which has no rules to read"):
        load_rules(map_run)
    with pytest.raises(UsageError, match="has no map"):
        load_rules(semantic_run)
