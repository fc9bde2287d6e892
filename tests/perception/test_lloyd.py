"""k-means of weighted rows, against scikit-learn."""

import numpy as np
import pytest
from sklearn.cluster import KMeans as Theirs

from semrl.perception.lloyd import k_means, nearest


def inertia(X, weights, centres):
    return float(weights @ np.square(X - centres[nearest(X, centres)]).sum(axis=1))


@pytest.mark.parametrize(("seed", "k", "d"), [(0, 2, 1), (1, 5, 2), (2, 8, 3)])
def test_it_is_as_good_as_scikit_learns(seed, k, d):
    rng = np.random.default_rng(seed)
    X, weights = rng.normal(size=(400, d)), rng.integers(1, 20, size=400).astype(float)
    theirs = Theirs(k, n_init=10, random_state=seed).fit(X, sample_weight=weights)
    ours = k_means(X, weights, k, seed=seed, starts=10)
    assert ours.shape == (k, d)
    assert inertia(X, weights, ours) <= 1.02 * theirs.inertia_


@pytest.mark.parametrize("seed", range(3))
def test_every_centre_is_the_weighted_mean_of_its_rows(seed):
    rng = np.random.default_rng(seed)
    X, weights = rng.normal(size=(200, 3)), rng.uniform(0.5, 3, size=200)
    centres = k_means(X, weights, 6, seed=seed)
    places = nearest(X, centres)
    for i, centre in enumerate(centres):
        np.testing.assert_allclose(centre, np.average(X[places == i], axis=0, weights=weights[places == i]))


def test_a_weight_is_a_number_of_rows():
    rng = np.random.default_rng(0)
    blobs = np.array([[0.0, 0], [9, 0], [0, 9]])[rng.integers(3, size=60)] + rng.normal(size=(60, 2)) * 0.1
    times = rng.integers(1, 5, size=60)
    weighted = k_means(blobs, times.astype(float), 3)
    repeated = k_means(np.repeat(blobs, times, axis=0), np.ones(times.sum()), 3)
    np.testing.assert_allclose(np.sort(weighted, axis=0), np.sort(repeated, axis=0))


def test_few_rows_are_their_own_centres():
    X = np.array([[1.0, 2], [3, 4]])
    centres = k_means(X, np.ones(2), 5)
    np.testing.assert_array_equal(centres, X)
    assert centres is not X
