"""Rules that are switched off count for nothing where they hold, in every forest, and elsewhere nothing changes."""

import numpy as np
import pytest

from semrl.world_model.rules import read_tree
from semrl.world_model.switching import SwitchedOff
from semrl.world_model.trees import Forests

NAMES, ACTIONS = ("x", "y"), ("LEFT", "RIGHT")


@pytest.fixture
def known():
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 20, size=(600, 2)).astype(np.float32)
    targets = np.column_stack([rows[:, 0] + 3 * (rows[:, 1] > 9) + 1, np.full(600, 5.0)])
    return Forests(3).fit(rows, targets, rng, leaf_rows=[2, 2]), rows


def inside(rows, region):
    return np.all([(rows[:, column] > low) & (rows[:, column] <= high) for column, low, high in region], axis=0)


@pytest.mark.parametrize("count", [1, 3, 8])
def test_they_count_for_nothing_where_they_hold_and_nowhere_else(known, count):
    forests, rows = known
    before = forests(rows)
    read = read_tree(forests.tree(0), "x", NAMES, ACTIONS)
    off = list(read.regions.values())[:count]
    forests.switch_off([SwitchedOff(0, region) for region in off])
    after = forests(rows)
    here = np.any([inside(rows, region) for region in off], axis=0)
    assert here.any() and here.all() == (count == 8)
    assert (before[:, here, 0] != 0).all() and (after[:, here, 0] == 0).all()
    assert np.array_equal(after[:, ~here], before[:, ~here]) and np.array_equal(after[..., 1], before[..., 1])
    assert [node for node in read.regions if inside(rows, read.regions[node]).any()] == list(read.by_leaf)
    forests.switch_off([])
    assert np.array_equal(forests(rows), before)


def test_regions_are_where_their_rules_hold(known):
    forests, rows = known
    read = read_tree(forests.tree(0), "x", NAMES, ACTIONS)
    for node, region in read.regions.items():
        assert [read.at(row) is read.by_leaf[node] for row in rows] == inside(rows, region).tolist()


def test_a_rule_that_always_holds_can_be_switched_off(known):
    forests, rows = known
    forests.switch_off([SwitchedOff(1, ())])
    assert (forests(rows)[..., 1] == 0).all() and (forests(rows)[..., 0] != 0).all()


def test_what_is_saved_and_read_is_what_was_grown(known):
    forests, rows = known
    before, rules = forests(rows), forests.tree(0)
    forests.switch_off([SwitchedOff(0, ()), SwitchedOff(1, ())])
    assert np.array_equal(forests.tree(0).means, rules.means)
    other = Forests(3)
    other.from_arrays(forests.to_arrays())
    assert np.array_equal(other(rows), before)


def test_one_forest_grown_anew_keeps_them_off_and_all_of_them_do_not(known):
    forests, rows = known
    forests.switch_off([SwitchedOff(1, ())])
    rng, targets = np.random.default_rng(1), np.full((600, 2), 7.0)
    forests.fit(rows, targets, rng, leaf_rows=[2, 2], member=0)
    assert (forests(rows)[..., 1] == 0).all()
    forests.fit(rows, targets, rng, leaf_rows=[2, 2])
    assert (forests(rows) == 7).all()


def test_names_are_of_what_is_said_and_about_what():
    def rules(values):
        rows = np.arange(40, dtype=np.float32)[:, None]
        tree = Forests(1).fit(rows, values(rows), np.random.default_rng(0), leaf_rows=[2]).tree(0)
        return read_tree(tree, "x", ("x",), ACTIONS).by_support

    one, two = rules(lambda x: np.where(x > 9, 1.0, 0.0))
    assert one.key != two.key and one.key.isidentifier()
    assert {rule.key for rule in rules(lambda x: np.where(x > 9, 2.0, 0.0))} == {one.key, two.key}
    assert not {rule.key for rule in rules(lambda x: np.where(x > 19, 1.0, 0.0))} & {one.key, two.key}
