"""k-means batch by batch, against scikit-learn and against the mean of all rows."""

import numpy as np
import pytest
from sklearn.cluster import KMeans as Theirs
from sklearn.metrics import adjusted_rand_score

from semrl.core.errors import UsageError
from semrl.perception.clustering.kmeans import KMeans, KMeansConfig


def inertia(X, centres):
    return float(np.square(np.linalg.norm(X[:, None] - centres, axis=2).min(axis=1)).sum())


def blobs(n, kinds, d=5, seed=0, spread=0.3):
    rng = np.random.default_rng(seed)
    which = rng.integers(kinds, size=n)
    return 4 * np.random.default_rng(7).normal(size=(kinds, d))[which] + spread * rng.normal(size=(n, d))


@pytest.mark.parametrize("kinds", [3, 10])
@pytest.mark.parametrize("start_rows", [100, 10_000])
def test_it_finds_what_scikit_learn_finds(kinds, start_rows):
    X = blobs(2_000, kinds)
    box = KMeans(KMeansConfig(max_classes=kinds, start_rows=start_rows))
    for batch in np.split(X, 50):
        box.partial_fit(batch)
    theirs = Theirs(kinds, n_init=10, random_state=0).fit(X)
    assert adjusted_rand_score(theirs.labels_, box.predict(X)) > 0.999
    assert inertia(X, box.centres_) <= 1.01 * theirs.inertia_


@pytest.mark.parametrize("seed", range(3))
def test_after_the_start_a_centre_is_the_mean_of_the_rows_that_it_has_had(seed):
    rng = np.random.default_rng(seed)
    box = KMeans(KMeansConfig(max_classes=4, start_rows=50)).partial_fit(rng.normal(size=(50, 3)))
    arrays = box.to_arrays()
    sums, counts = arrays["counts"][:, None] * arrays["centres"], arrays["counts"].copy()
    for batch in rng.normal(size=(30, 10, 3)):
        places = np.searchsorted(box.classes_, box.predict(batch))
        np.add.at(sums, places, batch)
        np.add.at(counts, places, 1)
        box.partial_fit(batch)
        np.testing.assert_allclose(box.centres_, sums / counts[:, None])


def test_the_rows_of_the_start_are_kept_as_long_as_needed_and_no_longer():
    box = KMeans(KMeansConfig(max_classes=3, start_rows=40))
    few = np.array([[0.0, 0.0], [5.0, 0.0]])
    for _ in range(60):  # 120 rows, but only two different ones: there is no third centre to begin with
        box.partial_fit(few)
    assert len(box.to_arrays()["rows"]) == 2 and box.n_clusters_ == 2
    box.partial_fit(np.array([[0.0, 9.0]]))
    assert box.n_clusters_ == 3
    assert box.to_arrays()["rows"].size == 0


def test_kinds_that_appear_late_in_the_start_get_the_free_numbers():
    box, kinds = KMeans(KMeansConfig(max_classes=4)), 5 * np.eye(4)
    for n in range(1, 5):
        box.partial_fit(np.repeat(kinds[:n], 3, axis=0))
        assert box.predict(kinds[:n]).tolist() == list(range(n))


@pytest.mark.parametrize("values", [{"max_classes": 0}, {"max_classes": 20, "start_rows": 10}, {"seed": -1}])
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError):
        KMeansConfig(**values)
