"""Classes of objects: how leaves are joined, and that a class keeps its number."""

import numpy as np
import pytest
from sklearn.cluster import AgglomerativeClustering

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.core.protocols import Persistent
from semrl.perception.clustering.birch import Birch, BirchConfig, match_classes, ward_clusters


def same_partition(a, b):
    return len({*zip(a, b, strict=True)}) == len({*a}) == len({*b})


def kinds_of_objects(kinds, n=200, d=10, seed=0):
    rng = np.random.default_rng(seed)
    which = rng.integers(kinds, size=n)
    return 5 * np.eye(max(kinds, d))[which, :d] + rng.normal(size=(n, d)) * 0.02, which


def test_each_leaf_is_a_class_while_there_are_few():
    X, which = kinds_of_objects(8)
    birch = Birch().partial_fit(X)
    labels = birch.predict(X)
    assert isinstance(birch, Persistent)
    assert labels.dtype == np.int64 and birch.n_clusters_ == 8
    assert same_partition(labels, which)
    assert birch.classes_.tolist() == list(range(8))
    for number, centre in zip(birch.classes_, birch.centres_, strict=True):
        np.testing.assert_allclose(centre, X[labels == number].mean(0), atol=1e-9)


@pytest.mark.parametrize("most", [1, 2, 10])
def test_more_leaves_are_joined_as_by_scikit_learns_ward_linkage(most):
    means = np.random.default_rng(0).normal(size=(60, 4))
    ours = ward_clusters(means, most)
    theirs = AgglomerativeClustering(n_clusters=most, linkage="ward").fit_predict(means)
    assert same_partition(ours, theirs)
    assert list(dict.fromkeys(ours.tolist())) == list(range(most))


def test_classes_are_ward_clusters_of_the_leaves_and_centres_weigh_rows():
    X = np.random.default_rng(0).normal(size=(500, 3))
    birch = Birch(BirchConfig(max_classes=6)).partial_fit(X)
    arrays = birch.to_arrays()
    means, counts = arrays["tree/leaves_means"], arrays["tree/leaves_counts"]
    assert len(means) == birch.n_clusters_ > 6
    theirs = AgglomerativeClustering(n_clusters=6, linkage="ward").fit_predict(means)
    assert same_partition(birch.leaf_classes_, theirs)
    assert birch.classes_.tolist() == list(range(6))
    nearest = np.linalg.norm(X[:, None] - means, axis=2).argmin(1)
    np.testing.assert_array_equal(birch.predict(X), birch.leaf_classes_[nearest])
    for number, centre in zip(birch.classes_, birch.centres_, strict=True):
        mine = birch.leaf_classes_ == number
        np.testing.assert_allclose(centre, np.average(means[mine], axis=0, weights=counts[mine]))


def test_a_class_keeps_its_number_while_leaves_appear():
    X, which = kinds_of_objects(10, n=2000)
    birch = Birch(BirchConfig(max_classes=10))
    numbers = {}
    for kind in range(10):  # kinds appear one after the other
        birch.partial_fit(X[which <= kind][: 100 * (kind + 1)])
        birch.partial_fit(X[which == kind][:20])
        for earlier in range(kind + 1):
            found = {*birch.predict(X[which == earlier]).tolist()}
            assert len(found) == 1
            assert numbers.setdefault(earlier, found) == found
    assert sorted(n for found in numbers.values() for n in found) == list(range(10))


def test_far_classes_keep_their_numbers_while_ward_regroups_the_rest():
    rng = np.random.default_rng(0)
    anchors = 40 * np.eye(8)[:5]
    birch = Birch(BirchConfig(max_classes=6, threshold=0.3))
    birch.partial_fit(np.repeat(anchors, 50, axis=0))
    before = birch.predict(anchors)
    for _ in range(30):  # a sixth kind, so wide that its leaves never stop coming
        birch.partial_fit(np.concatenate([anchors, rng.normal(size=(20, 8)) - 40]))
        np.testing.assert_array_equal(birch.predict(anchors), before)
        assert birch.classes_.min() >= 0 and birch.classes_.max() < 6
    assert birch.n_clusters_ > 100 and len(birch.classes_) == 6


def test_other_classes_keep_their_numbers_when_two_are_joined():
    small, large, far, new = np.array([[0.0, 0.0], [2.0, 0.0], [50.0, 0.0], [0.0, 90.0]])
    birch = Birch(BirchConfig(max_classes=3))
    birch.partial_fit(np.array([small, large, large, far]))
    assert birch.predict(np.array([small, large, far])).tolist() == [0, 1, 2]
    birch.partial_fit(new[None])  # Ward joins the near two, where most rows were of class 1
    assert birch.predict(np.array([small, large, far, new])).tolist() == [1, 1, 2, 0]


def test_numbers_go_where_most_rows_are():
    clusters = np.array([0, 0, 1, 2, 2])
    before = np.array([3, 1, 1, -1, -1])
    counts = np.array([5, 9, 20, 1, 1])
    # class 1 has 20 rows in cluster 1 and 9 in cluster 0, which is left class 3; cluster 2 is new
    assert match_classes(clusters, before, counts, 4).tolist() == [3, 1, 0]


def test_the_cap_on_leaves_is_kept():
    birch = Birch(BirchConfig(threshold=0.01, max_leaves=30))
    rng = np.random.default_rng(0)
    for _ in range(30):
        birch.partial_fit(rng.normal(size=(20, 5)))
        assert birch.n_clusters_ <= 30
        labels = birch.predict(rng.normal(size=(50, 5)))
        assert labels.min() >= 0 and labels.max() < 10
    assert birch.threshold_ > 0.01


def test_the_global_step_waits_for_a_change_of_leaves(monkeypatch):
    X, _ = kinds_of_objects(12)
    birch = Birch().partial_fit(X)
    calls = []
    monkeypatch.setattr("scipy.cluster.hierarchy.linkage", lambda *given: calls.append(given))
    for _ in range(3):
        birch.partial_fit(X[:50])
        birch.predict(X)
    assert not calls


@pytest.mark.parametrize("asked", [False, True])
@pytest.mark.parametrize("stop", [0, 3, 9])
def test_a_restored_birch_goes_on_bit_for_bit(stop, asked):
    config = BirchConfig(threshold=0.2, max_leaves=60)
    batches = np.random.default_rng(0).normal(size=(12, 30, 3))
    whole, first, restored = Birch(config), Birch(config), Birch(config)
    for batch in batches[:stop]:
        whole.partial_fit(batch)
        first.partial_fit(batch)
        if asked:
            first.predict(batch)
    restored.from_arrays(first.to_arrays())
    for batch in batches[stop:]:
        np.testing.assert_array_equal(
            whole.partial_fit(batch).predict(batch), restored.partial_fit(batch).predict(batch)
        )
    assert digest(whole.to_arrays()) == digest(restored.to_arrays())


def test_bad_input_is_refused_and_nothing_is_learned():
    birch = Birch()
    with pytest.raises(DataError, match="partial_fit first"):
        birch.predict(np.zeros((1, 10)))
    assert len(birch.partial_fit(np.zeros((0, 10))).classes_) == 0
    birch.partial_fit(kinds_of_objects(3)[0])
    before = digest(birch.to_arrays())
    for bad in (np.full((1, 10), np.nan), np.zeros((1, 9)), np.zeros(10)):
        with pytest.raises(DataError):
            birch.partial_fit(bad)
        with pytest.raises(DataError):
            birch.predict(bad)
    assert digest(birch.to_arrays()) == before
    assert birch.predict(np.zeros((0, 10))).shape == (0,)


def test_arrays_of_another_birch_are_refused():
    saved = Birch().partial_fit(kinds_of_objects(8)[0]).to_arrays()
    with pytest.raises(DataError, match="max_classes"):
        Birch(BirchConfig(max_classes=3)).from_arrays(saved)
    with pytest.raises(DataError, match="other leaves"):
        Birch().from_arrays(saved | {"classes/leaf_ids": saved["classes/leaf_ids"] + 1})
    with pytest.raises(DataError):
        Birch().from_arrays({})


@pytest.mark.parametrize("values", [{"max_classes": 0}, {"max_classes": 20, "max_leaves": 10}, {"threshold": -1}])
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError):
        BirchConfig(**values)


def test_a_common_kind_swallows_a_rare_neighbour_unless_leaves_are_compact():
    rng = np.random.default_rng(0)
    common = rng.normal([0, 0], 0.01, size=(2000, 2))
    rare = rng.normal([2, 0], 0.01, size=(20, 2))
    for compact, kinds in ((False, 1), (True, 2)):
        birch = Birch(BirchConfig(threshold=0.5, compact=compact))
        birch.partial_fit(common).partial_fit(rare)
        assert len(set(birch.predict(np.concatenate([common, rare])).tolist())) == kinds
