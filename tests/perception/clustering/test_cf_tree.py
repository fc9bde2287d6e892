"""What must be true of a CF tree, whatever it is fed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays as np_arrays
from sklearn.cluster import Birch as ReferenceBirch

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering.cf_store import N_NODES, ROOT
from semrl.perception.clustering.cf_tree import CFTree, CFTreeConfig


def tree(threshold=0.5, branching_factor=5, max_leaves=None):
    return CFTree(CFTreeConfig(threshold=threshold, branching_factor=branching_factor, max_leaves=max_leaves))


def cloud(seed=0, n=400, d=3):
    return np.random.default_rng(seed).normal(size=(n, d))


def blobs(seed=0, n=300, d=4, kinds=6):
    rng = np.random.default_rng(seed)
    centres = 10 * np.eye(max(d, kinds))[:kinds, :d] + 10 * np.arange(kinds)[:, None]
    which = rng.integers(kinds, size=n)
    return centres[which] + rng.normal(size=(n, d)) * 0.05, which


def nodes_of(grown):
    store = grown._store
    return store, range(int(store.counters[N_NODES]))


def same_partition(a, b):
    return len({*zip(a, b, strict=True)}) == len({*a}) == len({*b})


rows = np_arrays(
    np.float64,
    st.tuples(st.integers(0, 60), st.just(2)),
    elements=st.floats(-4, 4, width=32) | st.sampled_from([0.0, 1.0]),
)


@settings(max_examples=60, deadline=None)
@given(
    X=rows,
    threshold=st.sampled_from([0.0, 0.3, 1.0]),
    branching=st.integers(2, 5),
    cap=st.sampled_from([None, 1, 4]),
)
def test_invariants_hold_for_any_rows(X, threshold, branching, cap):
    grown = tree(threshold, branching, cap)
    ids = grown.insert(X)
    assert grown.leaf_counts_.sum() == len(X)
    assert (np.diff(grown.leaf_ids_) > 0).all()
    assert np.isin(ids, grown.leaf_ids_).all()
    assert (grown.leaf_radii_ <= grown.threshold_ * (1 + 1e-9)).all()
    assert cap is None or grown.n_leaves_ <= cap
    order, counts = np.unique(ids, return_counts=True)
    np.testing.assert_array_equal(order, grown.leaf_ids_)
    np.testing.assert_array_equal(counts, grown.leaf_counts_)
    for leaf, mean, radius in zip(order, grown.leaf_means_, grown.leaf_radii_, strict=True):
        mine = X[ids == leaf]
        np.testing.assert_allclose(mean, mine.mean(0), atol=1e-9)
        np.testing.assert_allclose(radius, np.sqrt(mine.var(0).sum()), atol=1e-7)


@pytest.mark.parametrize("branching", [2, 3, 7])
def test_nodes_hold_together(branching):
    grown = tree(0.2, branching).partial_fit(cloud())
    store, nodes = nodes_of(grown)
    leaves = []
    for node in nodes:
        children = store.children[node, : store.sizes[node]]
        assert 1 <= len(children) <= branching
        if store.is_bottom[node]:
            features, _ = store.leaves, leaves.extend(children)
        else:
            features = store.nodes
            assert (store.parents[children] == node).all()
        if node != store.counters[ROOT]:
            counts = features.counts[children]
            assert store.nodes.counts[node] == counts.sum()
            mean = counts @ features.means[children] / counts.sum()
            np.testing.assert_allclose(store.nodes.means[node], mean, atol=1e-12)
            around = ((features.means[children] - mean) ** 2).sum(1) @ counts
            np.testing.assert_allclose(
                store.nodes.deviations[node], features.deviations[children].sum() + around, atol=1e-9
            )
    assert sorted(leaves) == list(range(grown.n_leaves_))


def test_ids_are_never_changed_nor_used_again():
    grown, X = tree(0.3), cloud(n=600)
    given_out = grown.insert(X[:50])
    for start in range(50, 600, 50):
        before, means = grown.leaf_ids_.copy(), grown.leaf_means_.copy()
        new = grown.insert(X[start : start + 50])
        assert np.isin(before, grown.leaf_ids_).all()
        here = np.searchsorted(grown.leaf_ids_, before)
        untouched = ~np.isin(before, new)
        np.testing.assert_array_equal(grown.leaf_means_[here][untouched], means[untouched])
        assert (np.setdiff1d(grown.leaf_ids_, before) > before.max()).all()
        given_out = np.concatenate([given_out, new])
    np.testing.assert_array_equal(grown.resolve(given_out), given_out)
    np.testing.assert_array_equal(np.unique(given_out, return_counts=True)[1], grown.leaf_counts_)


@pytest.mark.parametrize(("threshold", "branching"), [(0.3, 4), (0.3, 50), (0.8, 10)])
def test_leaves_are_those_of_scikit_learn(threshold, branching):
    X = cloud(n=500)
    ours = tree(threshold, branching).partial_fit(X)
    theirs = ReferenceBirch(n_clusters=None, threshold=threshold, branching_factor=branching).fit(X)
    ours_sorted = ours.leaf_means_[np.lexsort(ours.leaf_means_.T)]
    centres = theirs.subcluster_centers_
    np.testing.assert_allclose(ours_sorted, centres[np.lexsort(centres.T)], atol=1e-9)
    assert same_partition(ours.predict(X), theirs.predict(X))


def test_separated_blobs_are_one_leaf_each():
    X, which = blobs()
    grown = tree()
    assert same_partition(grown.insert(X), which)
    assert same_partition(grown.predict(X), which)
    assert same_partition(grown.predict_by_descent(X), which)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_offset_changes_nothing(dtype):
    X = cloud(n=300, d=10).astype(np.float32)
    X = (np.round(X * 64) / 64).astype(dtype)  # exact in float32 at the offset too
    near, far = tree(1.5), tree(1.5)
    np.testing.assert_array_equal(near.insert(X), far.insert(X + dtype(1e3)))
    assert near.n_leaves_ > 20
    np.testing.assert_allclose(far.leaf_means_ - 1e3, near.leaf_means_, atol=1e-9)
    np.testing.assert_allclose(far.leaf_radii_, near.leaf_radii_, atol=1e-9)


@pytest.mark.parametrize("d", [1, 10, 33, 70])
def test_predict_finds_the_nearest_of_all_leaves(d):
    grown = tree(0.5, 4).partial_fit(cloud(n=300, d=d))
    queries = cloud(seed=1, n=50, d=d)
    distances = np.linalg.norm(queries[:, None] - grown.leaf_means_, axis=2)
    np.testing.assert_array_equal(grown.predict(queries), grown.leaf_ids_[distances.argmin(1)])
    descended = np.searchsorted(grown.leaf_ids_, grown.predict_by_descent(queries))
    found = distances[np.arange(50), descended]
    assert np.median(found) < np.median(distances)


def test_the_cap_is_kept_by_a_growing_threshold():
    grown, X, thresholds, seen, first = tree(0.05, 5, 40), cloud(n=1000), [0.05], [], []
    for row in X:
        seen.append(int(grown.insert(row[None])[0]))
        first.append(tuple(row))
        assert grown.n_leaves_ <= 40
        thresholds.append(grown.threshold_)
    assert thresholds == sorted(thresholds) and len({*thresholds}) > 2
    assert grown.n_leaves_ > 15  # a rebuilding does not throw everything together
    owners = grown.resolve(np.array(seen))
    order, counts = np.unique(owners, return_counts=True)
    np.testing.assert_array_equal(order, grown.leaf_ids_)
    np.testing.assert_array_equal(counts, grown.leaf_counts_)
    assert (owners <= np.array(seen)).all()  # the older one lives on
    for leaf, mean in zip(order, grown.leaf_means_, strict=True):
        np.testing.assert_allclose(mean, X[owners == leaf].mean(0), atol=1e-9)


@pytest.mark.parametrize("cap", [None, 30])
def test_batches_may_be_cut_anywhere(cap):
    X = cloud()
    whole, parts = tree(0.2, 5, cap).partial_fit(X), tree(0.2, 5, cap)
    for part in np.split(X, [0, 1, 7, 150, 151, 399]):
        parts.partial_fit(part)
    assert digest(whole.to_arrays()) == digest(parts.to_arrays())


@pytest.mark.parametrize("cap", [None, 30])
@pytest.mark.parametrize("stop", [0, 1, 77, 250])
def test_a_restored_tree_goes_on_bit_for_bit(cap, stop):
    X, grown, restored = cloud(), tree(0.2, 5, cap), tree(0.2, 5, cap)
    grown.partial_fit(X[:stop])
    restored.from_arrays(grown.to_arrays())
    assert digest(restored.to_arrays()) == digest(grown.to_arrays())
    np.testing.assert_array_equal(grown.insert(X[stop:]), restored.insert(X[stop:]))
    assert digest(restored.to_arrays()) == digest(grown.to_arrays())
    np.testing.assert_array_equal(grown.predict(X), restored.predict(X))


def test_saved_arrays_are_copies_and_predict_learns_nothing():
    grown, X = tree(0.2, 5, 30).partial_fit(cloud()), cloud(1)
    saved = grown.to_arrays()
    before = digest(saved)
    kept = X.copy()
    grown.predict(X)
    grown.predict_by_descent(X)
    assert digest(grown.to_arrays()) == before
    other = tree(0.2, 5, 30)
    other.from_arrays(saved)
    other.partial_fit(X)
    assert digest(saved) == before
    np.testing.assert_array_equal(X, kept)
    with pytest.raises(ValueError, match="read-only"):
        grown.leaf_means_[0] = 0


def test_arrays_that_are_no_tree_are_refused():
    saved = tree(0.2, 5).partial_fit(cloud()).to_arrays()
    lost = {name: array for name, array in saved.items() if name != "children"}
    wild = saved | {"children": saved["children"] + 10_000}
    short = saved | {"leaf_ids": saved["leaf_ids"][:-1]}
    for arrays in (lost, wild, short, {}):
        with pytest.raises(DataError):
            tree(0.2, 5).from_arrays(arrays)
    with pytest.raises(DataError, match="branching factor 7"):
        tree(0.2, 7).from_arrays(saved)


@pytest.mark.parametrize(
    "bad",
    [
        np.array([[0.0, np.nan, 0.0]]),
        np.array([[0.0, np.inf, 0.0]]),
        np.array([[0.0, 0.0, 0.0], [1e200, 0.0, 0.0]]),
        np.zeros((2, 4)),
        np.zeros((0, 4)),
        np.zeros(3),
        np.zeros((2, 0)),
        np.array([["a", "b", "c"]]),
    ],
)
def test_bad_rows_are_refused_and_nothing_is_learned(bad):
    grown = tree().partial_fit(cloud())
    before = digest(grown.to_arrays())
    for method in (grown.partial_fit, grown.insert, grown.predict, grown.predict_by_descent):
        with pytest.raises(DataError) as error:
            method(bad)
        assert "\n" not in str(error.value)
    assert digest(grown.to_arrays()) == before


def test_an_empty_tree_and_empty_batches():
    grown = tree()
    assert grown.insert(np.zeros((0, 3))).shape == (0,)
    assert grown.n_leaves_ == 0 and len(grown.leaf_radii_) == 0
    with pytest.raises(DataError, match="partial_fit first"):
        grown.predict(np.zeros((1, 3)))
    with pytest.raises(DataError):
        grown.resolve(np.array([0]))
    grown.partial_fit(np.ones((2, 5)))
    assert grown.n_features_in_ == 5 and grown.leaf_counts_.tolist() == [2]
    assert grown.predict(np.zeros((0, 5))).shape == (0,)


@pytest.mark.parametrize(
    "values", [{"threshold": -1}, {"threshold": np.nan}, {"branching_factor": 1}, {"max_leaves": 0}]
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError):
        CFTreeConfig(**values)


def test_rows_of_compact_leaves_were_near_when_they_came():
    rows = np.random.default_rng(1).normal(size=(400, 3))
    tree = CFTree(CFTreeConfig(threshold=0.5, compact=True))
    for row in rows:
        before = dict(zip(tree.leaf_ids_.tolist(), tree.leaf_means_.copy(), strict=True)) if tree.n_leaves_ else {}
        leaf = int(tree.insert(row[None])[0])
        assert leaf not in before or np.linalg.norm(row - before[leaf]) <= 0.5
    saved = {name: array.copy() for name, array in tree.to_arrays().items()}
    again = CFTree(CFTreeConfig(threshold=0.5, compact=True))
    again.from_arrays(saved)
    np.testing.assert_array_equal(again.insert(rows + 0.3), tree.insert(rows + 0.3))
