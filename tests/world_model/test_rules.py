"""Trees are read as rules that say what they predict."""

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.world_model.nearest import Nearest, none_compared
from semrl.world_model.rules import feature_names, read_tree
from semrl.world_model.tree_kernels import Relations, lay_out
from semrl.world_model.trees import Forests

NAMES, ACTIONS = ("x", "y"), ("LEFT", "RIGHT")
DIFFERENCES, DISTANCES = (Relations(np.array([[0, 1]]), distances, none_compared()) for distances in (False, True))
NEAREST = Relations(
    np.zeros((0, 2), np.int64), True, Nearest(np.array([[0, 1, -1], [-1, -1, -1]]), np.ones((2, 3), np.float32))
)


def forest(rows, targets, leaf_rows=2):
    leaves = [leaf_rows] * targets.shape[1]
    return Forests(1).fit(rows, targets, np.random.default_rng(0), leaf_rows=leaves)


def test_every_column_has_a_name():
    for past_states, past_actions, relations in ((2, 0, DISTANCES), (4, 3, DISTANCES), (2, 1, NEAREST)):
        names = feature_names(NAMES, past_states, past_actions, relations)
        rows = lay_out(
            np.zeros((1, past_states, 2), np.float32),
            np.zeros((1, past_actions), np.int64),
            np.zeros(1, int),
            relations,
        )
        assert len(names) == len(set(names)) == rows.shape[1]


def test_names_stand_where_their_numbers_do():
    states = np.array([[[5, 2], [4, 4], [1, 1]]], np.float32)
    row = lay_out(states, np.array([[1]]), np.array([0]), DIFFERENCES)[0]
    told = dict(zip(feature_names(NAMES, 3, 1, DIFFERENCES), row.tolist(), strict=True))
    assert told == {
        "x": 5, "y": 2, "x, if it goes on,": 6, "y, if it goes on,": 0,
        "the last change of x": 1, "the last change of y": -2,
        "the change of x 2 decisions ago": 3, "the change of y 2 decisions ago": 3,
        "x − y": 3, "x − y, if both go on,": 6, "the action": 0, "the action 1 before": 1,
    }  # fmt: skip


def test_distances_stand_between_bars():
    states = np.array([[[2, 5], [4, 4]]], np.float32)
    names = feature_names(NAMES, 2, 0, DISTANCES)
    row = lay_out(states, np.zeros((1, 0), np.int64), np.array([0]), DISTANCES)[0]
    told = dict(zip(names, row.tolist(), strict=True))
    assert (told["x − y"], told["|x − y|"], told["|x − y|, if both go on,"]) == (-3, 3, 6)


def test_a_world_of_two_rules_is_read_as_two_rules():
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 20, size=(1000, 2)).astype(np.float32)
    tree = forest(rows, np.where(rows[:, :1] > 11, -3.0, 2.0)).tree(0)
    one, two = read_tree(tree, "x", NAMES, ACTIONS).by_support
    assert (one.value, one.conditions, one.decisions) == (2.0, ("x ≤ 11.5",), int((rows[:, 0] <= 11).sum()))
    assert (two.value, two.conditions, two.error) == (-3.0, ("x > 11.5",), 0.0)


def test_rules_part_all_decisions_and_say_how_far_off_they_are():
    rng = np.random.default_rng(1)
    rows = rng.integers(0, 20, size=(2000, 2)).astype(np.float32)
    targets = (rows[:, 0] > 9) * 8.0 + (rows[:, 1] > 14) * 2.0 + rng.normal(scale=0.3, size=2000)
    tree = forest(rows, targets[:, None]).tree(0)
    for most in (1, 2, 4, 7):
        found = read_tree(tree, "z", NAMES, ACTIONS, most=most).by_support
        assert len(found) == most and sum(rule.decisions for rule in found) == 2000
        total = sum(rule.decisions * rule.error**2 for rule in found) / 2000
        assert total == pytest.approx({1: targets.var()}.get(most, total), rel=1e-4)
    four = read_tree(tree, "z", NAMES, ACTIONS, most=4).by_support
    assert sorted(round(rule.value) for rule in four) == [0, 2, 8, 10]
    assert all(rule.error == pytest.approx(0.3, abs=0.05) for rule in four)
    by_conditions = {rule.conditions: round(rule.value) for rule in four}
    assert by_conditions["x > 9.5", "y > 14.5"] == 10


def test_actions_are_called_by_their_names():
    rows = np.random.default_rng(0).integers(-1, 2, size=(300, 1)).astype(np.float32)
    tree = forest(rows, rows**2).tree(0)
    said = {rule.conditions for rule in read_tree(tree, "x", ["the action 1 before"], ACTIONS).by_support}
    assert ("the action 1 before is LEFT",) in said
    assert said <= {(f"the action 1 before is {what}",) for what in ("LEFT", "RIGHT", "LEFT or RIGHT", "not there yet")}


def test_each_number_has_a_tree_of_its_own():
    rows = np.random.default_rng(0).integers(0, 9, size=(200, 2)).astype(np.float32)
    grown = forest(rows, np.column_stack([rows[:, 0] > 4, rows[:, 1] > 2, np.full(200, 7)]).astype(float))
    said = [[rule.conditions for rule in read_tree(grown.tree(i), "n", NAMES, ACTIONS).by_support] for i in range(3)]
    assert [sorted(one) for one in said] == [[("x > 4.5",), ("x ≤ 4.5",)], [("y > 2.5",), ("y ≤ 2.5",)], [()]]


def test_no_rule_at_all_cannot_be_asked_for():
    with pytest.raises(UsageError, match="at least one rule"):
        read_tree(forest(np.ones((4, 2), np.float32), np.ones((4, 1))).tree(0), "x", NAMES, ACTIONS, most=0)


def test_numbers_are_told_in_the_unit_that_is_asked_for():
    rows = np.random.default_rng(0).integers(0, 20, size=(1000, 3)).astype(np.float32)
    tree = forest(rows, np.where((rows[:, :1] > 11) & (rows[:, 2:] > 6), -3.0, 2.0)).tree(0)
    names = ("x", "y", "the action")
    plain, scaled = (
        read_tree(tree, "x", names, ACTIONS).by_support,
        read_tree(tree, "x", names, ACTIONS, scale=0.5, value_scale=10).by_support,
    )
    assert {rule.value for rule in plain} == {-3, 2} and {rule.value for rule in scaled} == {-30, 20}
    assert any("x > 11.5" in rule.conditions for rule in plain)
    assert any("x > 5.75" in rule.conditions for rule in scaled)
    actions = [{text for rule in told for text in rule.conditions if "action" in text} for told in (plain, scaled)]
    assert actions[0] == actions[1] and actions[0]


@pytest.mark.parametrize("most", [1, 3, 8])
def test_the_rule_that_fires_is_the_one_whose_decisions_it_counts(most):
    rng = np.random.default_rng(most)
    rows = rng.integers(0, 9, (300, 3)).astype(np.float32)
    targets = np.column_stack([(rows[:, 0] > 4) * 3.0 + (rows[:, 1] > 2) * rows[:, 2], np.zeros(300)])
    read = read_tree(forest(rows, targets).tree(0), "n", ("a", "b", "c"), ACTIONS, most=most)
    fired = [read.at(row) for row in rows]
    assert len(read.by_support) <= most
    for rule in read.by_support:
        here = np.array([one is rule for one in fired])
        assert here.sum() == rule.decisions
        assert targets[here, 0].mean() == pytest.approx(rule.value, abs=1e-5)
