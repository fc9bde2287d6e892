"""What the pipeline asks of every clusterer, of all of them alike."""

import numpy as np
import pytest

from semrl.core.arrays import digest
from semrl.core.errors import DataError
from semrl.perception.clustering.birch import Birch, BirchConfig
from semrl.perception.clustering.kmeans import KMeans, KMeansConfig
from semrl.perception.clustering.som import SelfOrganisingMap, SelfOrganisingMapConfig
from semrl.perception.clustering.svm import SVMClassifier, SVMConfig

MAKERS = {
    "birch": lambda most: Birch(BirchConfig(max_classes=most)),
    "kmeans": lambda most: KMeans(KMeansConfig(max_classes=most, start_rows=100)),
    "som": lambda most: SelfOrganisingMap(SelfOrganisingMapConfig(max_classes=most, decay_rows=200)),
    "svm": lambda most: SVMClassifier(SVMConfig(max_classes=most), Birch(BirchConfig(max_classes=most))),
}


@pytest.fixture(params=MAKERS, name="make")
def each_maker(request):
    return MAKERS[request.param]


def blobs(n, kinds=5, d=6, seed=0):
    """Rows of a few kinds that lie far apart, and which kind each is of."""
    rng = np.random.default_rng(seed)
    which = rng.integers(kinds, size=n)
    return 4 * np.eye(d)[which] + 0.05 * rng.normal(size=(n, d)), which


def same_partition(a, b):
    return len({*zip(a, b, strict=True)}) == len({*a}) == len({*b})


def learn(box, X, size=25):
    for start in range(0, len(X), size):
        box.partial_fit(X[start : start + size])
    return box


def test_it_finds_kinds_that_lie_far_apart(make):
    box = learn(make(5), blobs(1_000)[0])
    fresh, which = blobs(300, seed=1)
    classes = box.predict(fresh)
    assert classes.dtype == np.int64 and same_partition(classes, which)
    assert box.classes_.tolist() == sorted({*classes.tolist()})
    assert box.n_clusters_ >= len(box.classes_) == 5
    for number, centre in zip(box.classes_, box.centres_, strict=True):
        np.testing.assert_allclose(centre, fresh[classes == number].mean(axis=0), atol=0.2)


def test_it_is_fitted_by_the_first_row_and_not_by_none(make):
    box = make(5)
    assert not box.is_fitted and box.n_clusters_ == 0 and len(box.classes_) == 0
    assert not box.partial_fit(np.zeros((0, 6))).is_fitted
    with pytest.raises(DataError, match="partial_fit first"):
        box.predict(np.zeros((1, 6)))
    box.partial_fit(np.ones((1, 6)))
    assert box.is_fitted and box.n_clusters_ == 1
    assert box.predict(np.ones((3, 6))).tolist() == [0, 0, 0]
    np.testing.assert_allclose(box.centres_, np.ones((1, 6)))


def test_a_class_keeps_its_number_while_more_is_learned(make):
    box, (X, which) = make(5), blobs(1_500)
    learn(box, X[:750])
    before = {kind: box.predict(X[which == kind][:1])[0] for kind in range(5)}
    for start in range(750, 1_500, 50):
        box.partial_fit(X[start : start + 50])
        assert {kind: box.predict(X[which == kind][:1])[0] for kind in range(5)} == before


def test_there_are_never_more_classes_than_asked_for(make):
    box, rng = make(3), np.random.default_rng(0)
    for _ in range(20):
        box.partial_fit(rng.normal(size=(20, 4)))
        classes = box.predict(rng.normal(size=(100, 4)))
        assert set(classes.tolist()) <= set(box.classes_.tolist()) <= {0, 1, 2}
        assert box.centres_.shape == (len(box.classes_), 4)


def test_the_revision_changes_with_what_is_learned_and_restored(make):
    box = make(5)
    seen = {id(box.revision): box.revision}
    for change in (lambda: box.partial_fit(blobs(50)[0]), lambda: box.from_arrays(box.to_arrays())):
        change()
        assert id(box.revision) not in seen
        seen[id(box.revision)] = box.revision
    box.predict(blobs(5)[0])
    assert id(box.revision) in seen


def test_the_class_of_a_row_does_not_depend_on_the_others(make):
    box = learn(make(5), np.random.default_rng(0).normal(size=(400, 6)))
    rows = np.random.default_rng(1).normal(size=(100, 6))
    together = box.predict(rows)
    assert [int(box.predict(row[None])[0]) for row in rows] == together.tolist()
    assert box.predict(rows[:0]).shape == (0,)


@pytest.mark.parametrize("stop", [0, 2, 7, 15])
def test_a_restored_one_goes_on_bit_for_bit(make, stop):
    batches = np.random.default_rng(0).normal(size=(16, 20, 3))
    whole, first, restored = make(5), make(5), make(5)
    for batch in batches[:stop]:
        whole.partial_fit(batch)
        first.partial_fit(batch).predict(batch)
    restored.from_arrays(first.to_arrays())
    for batch in batches[stop:]:
        expected = whole.partial_fit(batch).predict(batch)
        np.testing.assert_array_equal(restored.partial_fit(batch).predict(batch), expected)
    assert digest(whole.to_arrays()) == digest(restored.to_arrays())


def test_bad_rows_are_refused_and_nothing_is_learned(make):
    box = learn(make(5), blobs(200)[0])
    before = digest(box.to_arrays())
    for bad in (np.full((1, 6), np.nan), np.zeros((1, 5)), np.zeros(6), np.zeros((2, 0)), np.array([["a"] * 6])):
        for method in (box.partial_fit, box.predict):
            with pytest.raises(DataError):
                method(bad)
    assert digest(box.to_arrays()) == before


@pytest.mark.parametrize("name", ["kmeans", "som", "svm"])
def test_arrays_of_another_one_are_refused(name):
    rows = np.random.default_rng(0).normal(size=(300, 4))
    small, large = MAKERS[name](3), learn(MAKERS[name](8), rows)
    learn(small, rows)
    before = digest(small.to_arrays())
    with pytest.raises(DataError):
        small.from_arrays(large.to_arrays())
    for left_out in large.to_arrays():
        if left_out.startswith("teacher"):
            continue
        with pytest.raises(DataError, match="lack"):
            small.from_arrays({key: array for key, array in small.to_arrays().items() if key != left_out})
    assert digest(small.to_arrays()) == before
