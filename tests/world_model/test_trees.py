"""Trees find sharp rules; grown and asked in compiled code they are what scikit-learn would grow."""

import numpy as np
import pytest
from sklearn.tree import DecisionTreeRegressor

from semrl.core import NO_ACTION
from semrl.world_model.cart import MAX_BINS, bins_of
from semrl.world_model.nearest import none_compared
from semrl.world_model.tree_kernels import Relations, lay_out
from semrl.world_model.trees import Forests


def wholes(n, d, seed=0, most=30):
    return np.random.default_rng(seed).integers(0, most, size=(n, d)).astype(np.float32)


def compared(dimension, distances=False):
    """All pairs of so many numbers."""
    return Relations(np.argwhere(np.triu(np.ones((dimension, dimension)), 1)), distances, none_compared())


def fitted(rows, targets, *, members=1, leaf_rows=3, seed=0, hidden_column=None):
    leaves = [leaf_rows] * targets.shape[1]
    return Forests(members).fit(
        rows, targets, np.random.default_rng(seed), leaf_rows=leaves, hidden_column=hidden_column
    )


def test_it_is_the_trees_of_scikit_learn():
    rows, test = wholes(800, 5), wholes(300, 5, seed=1)
    targets = np.column_stack([rows[:, 0] * 3.0 + rows[:, 1] ** 2, np.sin(rows[:, 2]) + (rows[:, 3] > rows[:, 4])])
    targets += np.random.default_rng(0).normal(scale=0.01, size=targets.shape)  # no two cuts are equally good
    forest = fitted(rows, targets)
    theirs = [
        DecisionTreeRegressor(min_samples_leaf=3, random_state=0).fit(rows, column).predict(rows)
        for column in targets.T
    ]
    np.testing.assert_allclose(forest(rows)[0], np.column_stack(theirs), atol=1e-3)
    assert np.isfinite(forest(test)).all()


def by_all_cuts(rows, targets, leaf_rows):
    """Grow a tree by trying every cut of every column anew; return what it predicts for its rows."""
    n, total, best, chosen = len(rows), targets.sum(), targets.sum() ** 2 / len(rows) + 1e-9, None
    for column in rows.T:
        for cut in np.unique(column)[:-1]:
            left = column <= cut
            k, part = left.sum(), targets[left].sum()
            if min(k, n - k) >= leaf_rows and (explained := part**2 / k + (total - part) ** 2 / (n - k)) > best:
                best, chosen = explained, left
    if chosen is None or n < 2 * leaf_rows:
        return np.full(n, targets.mean())
    told = np.empty(n)
    for side in (chosen, ~chosen):
        told[side] = by_all_cuts(rows[side], targets[side], leaf_rows)
    return told


@pytest.mark.parametrize("unit", [1.0, 0.5], ids=["large nodes by their siblings", "every node by its rows"])
@pytest.mark.parametrize("leaf_rows", [2, 9])
def test_no_cut_is_better_and_of_equals_the_first_is_taken(unit, leaf_rows):
    rows, rng = wholes(900, 4, most=40), np.random.default_rng(3)
    peeled = (rows[:, :2] > 36).sum(axis=1) * 5  # a few rows at a time leave a large rest
    targets = unit * (peeled + rng.integers(-1, 2, size=900) * (rows[:, 2] > 30))
    told = fitted(rows, targets[:, None], leaf_rows=leaf_rows)(rows)[0, :, 0]
    np.testing.assert_allclose(told, by_all_cuts(rows, targets, leaf_rows), atol=1e-5)


def test_every_leaf_has_enough_rows_and_predicts_their_mean():
    rows, rng = wholes(500, 3), np.random.default_rng(0)
    targets = rng.normal(size=(500, 1))
    told = fitted(rows, targets, leaf_rows=20)(rows)[0, :, 0]
    for value in np.unique(told):
        mine = told == value
        assert mine.sum() >= 20 and targets[mine].mean() == pytest.approx(value, abs=1e-5)


def test_numbers_of_few_values_have_a_bin_each_and_others_about_equally_full_ones():
    rows = np.column_stack([wholes(5000, 1)[:, 0], np.random.default_rng(0).normal(size=5000)]).astype(np.float32)
    places, cuts = bins_of(rows)
    assert len(cuts[0]) == 29 and places[0].tolist() == rows[:, 0].tolist()
    counts = np.bincount(places[1])
    assert len(counts) == len(cuts[1]) + 1 <= MAX_BINS and counts.max() < 3 * 5000 / MAX_BINS
    for column, cut, place in zip(rows.T, cuts, places, strict=True):
        np.testing.assert_array_equal((column[:, None] > cut).sum(axis=1), place)


def test_what_is_always_the_same_needs_no_cut():
    rows = wholes(50, 2)
    assert (fitted(rows, np.full((50, 1), 7.0))(wholes(9, 2, seed=1)) == 7).all()
    assert (fitted(np.ones((50, 2), np.float32), np.arange(50.0)[:, None])(rows) == 24.5).all()


def test_several_forests_agree_where_much_was_seen_and_differ_where_not():
    rows = np.concatenate([np.tile(np.arange(10, dtype=np.float32), 200), np.arange(20, 100, 8)])[:, None]
    targets = np.random.default_rng(0).normal(scale=0.1, size=rows.shape) + np.sign(rows - 5.5)
    told = fitted(rows.astype(np.float32), targets, members=5)(np.array([[3], [8], [60]], np.float32))[:, :, 0]
    assert told.shape == (5, 3) and (np.abs(told[:, :2] - [-1, 1]) < 0.05).all()
    assert told[:, 2].std() > 3 * told[:, :2].std(axis=0).max()


def test_one_member_is_grown_anew_and_the_others_stay():
    rows, targets = wholes(300, 3), np.random.default_rng(0).normal(size=(300, 2))
    forests = fitted(rows, targets, members=3)
    before, sizes = forests(rows), [len(forests.tree(target).means) for target in range(2)]
    forests.fit(rows[:40], targets[:40] + 10, np.random.default_rng(1), leaf_rows=[3, 3], member=1)
    after = forests(rows)
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    assert (after[1] > before[1].max()).all() and [len(forests.tree(target).means) for target in range(2)] == sizes
    again = Forests(3)
    again.from_arrays(forests.to_arrays())
    np.testing.assert_array_equal(again(rows), after)


def test_the_same_draw_grows_the_same():
    rows, targets = wholes(200, 3), np.random.default_rng(0).normal(size=(200, 2))
    one, two, other = (fitted(rows, targets, members=2, seed=seed)(rows) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, two)
    assert (one != other).any()


@pytest.mark.parametrize("distances", [False, True])
def test_numbers_are_seen_in_relation_to_each_other(distances):
    states = np.array([[[2, 5], [1, 6], [1, 4]]], np.float32)
    row = lay_out(states, np.array([[1, 0]]), np.array([1]), compared(2, distances))
    now, ahead, changes, apart = [2, 5], [3, 4], [1, -1, 0, 2], [3, 1] if distances else []
    assert row.tolist() == [[*now, *ahead, *changes, 2 - 5, 3 - 4, *apart, 1, 1, 0]] and row.dtype == np.float32


def test_only_what_is_comparable_is_compared():
    states = np.arange(6, dtype=np.float32).reshape(1, 2, 3) ** 2
    relations = Relations(np.array([[0, 2]]), False, none_compared())
    row = lay_out(states, np.zeros((1, 0), np.int64), np.array([7]), relations)
    assert row.shape == (1, 12) and row[0, -3:].tolist() == [0 - 4, -9 - (8 - 25), 7]


def test_a_contact_is_one_cut_of_a_distance():
    windows = np.random.default_rng(0).integers(-20, 20, size=(2000, 2, 2)).astype(np.float32)
    touching = (np.abs(windows[:, 0, 0] - windows[:, 0, 1]) <= 3).astype(float)[:, None]
    nothing, still = np.zeros((2000, 0), np.int64), np.zeros(2000, np.int64)
    cuts = [
        (fitted(lay_out(windows, nothing, still, compared(2, distances)), touching).tree(0).columns >= 0).sum()
        for distances in (False, True)
    ]
    assert cuts[0] >= 2 and cuts[1] == 1


def test_the_last_tree_may_be_kept_from_looking_at_a_column():
    rows = wholes(500, 2)
    targets = np.column_stack([rows[:, 0] > 9, rows[:, 0] > 9]).astype(float)
    told = fitted(rows, targets, hidden_column=0)(rows)[0]
    np.testing.assert_array_equal(told[:, 0], targets[:, 0])
    assert np.corrcoef(told[:, 1], targets[:, 1])[0, 1] < 0.5


def test_rolled_forward_each_forest_goes_its_own_way_until_a_reward():
    """A glider is pushed by the action; it is paid at 6 and beyond, and where it is may be worth something."""
    rng = np.random.default_rng(0)
    before, now, actions = rng.integers(-9, 9, 4000), rng.integers(-9, 9, 4000), rng.integers(2, size=4000)
    windows = np.stack([now, before], axis=1)[:, :, None].astype(np.float32)
    rows = lay_out(windows, np.zeros((4000, 0), np.int64), actions, compared(1))
    moved = now - before + 2 * actions - 1
    targets = np.column_stack([moved, now + moved >= 6, now / 10])
    forests = fitted(rows, targets, members=2, leaf_rows=1, hidden_column=rows.shape[1] - 1)
    sequences = np.array([[1, 1, 1, 1], [0, 0, 0, 0], [1, 0, 1, 0]])
    none = np.zeros(0, np.float32)
    known = np.zeros(1, np.float32), np.zeros((2, 1), np.float32), none
    states, rewards, values = forests.roll(*known, sequences, compared(1))
    assert states[:, :, 0].round(3).tolist() == [[1, 3, 6, 6], [-1, -3, -6, -10], [1, 1, 2, 2]]
    assert rewards.tolist() == [[[0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]] * 2
    np.testing.assert_allclose(values, [[0, -0.9, 0.2]] * 2, atol=1e-3)  # −9 is the least that was seen


def rolled_alone(forests, member, known, sequence, relations, *, ending):
    """Roll one sequence in one forest, a decision at a time, to a reward that ends it."""

    def seen(chosen):
        return lay_out(window[None], past[None], np.array([chosen]), relations)

    (inertia, window, past), predicted, rewards, over = known, [], np.zeros(len(sequence), np.float32), False
    for t, action in enumerate(sequence):
        if not over:
            told = forests(seen(action))[member, 0]
            moved = told[:-2] + inertia * (window[0] - window[1])
            window = np.concatenate([window[:1] + moved, window[:-1]])
            past = np.append(np.float32(action), past)[: len(past)]
            rewards[t] = np.rint(told[-2])
            over = rewards[t] != 0 and ending[int(rewards[t] > 0)]
        predicted.append(window[0])
    beyond = 0 if over else forests(seen(NO_ACTION))[member, 0, -1]
    return np.array(predicted), rewards, np.float32(beyond)


@pytest.mark.parametrize("ending", [(True, True), (True, False), (False, False)], ids=str)
@pytest.mark.parametrize(
    ("dimension", "past_states", "past_actions", "distances"), [(1, 2, 0, False), (3, 4, 3, False), (3, 4, 3, True)]
)
def test_together_sequences_come_to_what_each_comes_to_alone(dimension, past_states, past_actions, distances, ending):
    rng = np.random.default_rng(dimension)
    windows = rng.normal(size=(900, past_states, dimension)).astype(np.float32)
    actions = rng.integers(3, size=(900, past_actions + 1))
    relations = compared(dimension, distances)
    rows = lay_out(windows, actions[:, 1:], actions[:, 0], relations)
    paid = np.sign(windows[:, 0, 0]) * (np.abs(windows[:, 0, 0]) > 1.5)
    targets = np.column_stack([rng.normal(scale=0.5, size=(900, dimension)), paid, rng.normal(size=900)])
    forests = fitted(rows, targets, members=2, hidden_column=rows.shape[1] - 1 - past_actions)
    beginning = rng.integers(3, size=(5, 4))[rng.integers(5, size=40)]  # many begin alike, and some are alike
    sequences = np.concatenate([beginning, rng.integers(3, size=(40, 3))], axis=1)
    sequences[rng.integers(40, size=8)] = sequences[7]
    inertia = np.arange(dimension, dtype=np.float32) % 2  # the second of three numbers goes on by itself
    known = inertia, 0.2 * windows[0], actions[0, 1:].astype(np.float32)
    states, rewards, values = forests.roll(*known, sequences, relations, ending=np.array(ending))
    for member, s in np.ndindex(2, 40):
        alone, paid_alone, beyond = rolled_alone(forests, member, known, sequences[s], relations, ending=ending)
        assert member or states[s].tobytes() == alone.tobytes()
        assert rewards[member, s].tobytes() == paid_alone.tobytes() and values[member, s] == beyond
    ended = rewards.any(axis=2)
    assert ended.any() and not ended.all()
    assert ((rewards != 0).sum(axis=2) > 1).any() == (ending != (True, True))
