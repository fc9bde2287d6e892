"""Validation indices against scikit-learn and against the formulas written out."""

from itertools import product

import numpy as np
import pytest
from sklearn.metrics import davies_bouldin_score, silhouette_score

from semrl.core.errors import DataError
from semrl_thesis import cluster_indices as indices


@pytest.fixture
def points():
    rng = np.random.default_rng(0)
    labels = np.array([7, 2, 9])[rng.integers(3, size=80)]
    return rng.normal(size=(80, 3)) + labels[:, None] / 2, labels


def distance(u, w):
    return float(np.sqrt(((u - w) ** 2).sum()))


def test_measures_are_the_printed_formulas(points):
    X, labels = points
    A, B = X[labels == 2], X[labels == 9]
    within = [distance(u, w) for u, w in product(A, A)]
    between = [distance(u, w) for u, w in product(A, B)]
    assert indices.diameter(A) == pytest.approx(max(within))
    assert indices.average_within_distance(A) == pytest.approx(sum(within) / (2 * len(A)))
    assert indices.average_centroid_distance(A) == pytest.approx(sum(distance(u, A.mean(0)) for u in A) / (2 * len(A)))
    assert indices.nearest_distance(A, B) == pytest.approx(min(between))
    assert indices.average_between_distance(A, B) == pytest.approx(sum(between) / (2 * (len(A) + len(B))))
    assert indices.centroid_distance(A, B) == pytest.approx(distance(A.mean(0), B.mean(0)))


def test_indices_of_a_whole_clustering(points):
    X, labels = points
    assert indices.silhouette(X, labels) == pytest.approx(silhouette_score(X, labels))
    assert indices.davies_bouldin(X, labels) == pytest.approx(davies_bouldin_score(X, labels))
    pairs = [(distance(X[i], X[j]), labels[i] == labels[j]) for i in range(80) for j in range(i)]
    expected = min(d for d, same in pairs if not same) / max(d for d, same in pairs if same)
    assert indices.dunn(X, labels) == pytest.approx(expected)


def test_the_summary_holds_what_the_functions_give(points):
    X, labels = points
    found = indices.cluster_indices(X, labels)
    assert found.labels.tolist() == [2, 7, 9]
    assert found.silhouette == indices.silhouette(X, labels)
    assert found.davies_bouldin == indices.davies_bouldin(X, labels)
    assert found.dunn == indices.dunn(X, labels)
    clusters = [X[labels == number] for number in found.labels]
    for i, j in product(range(3), range(3)):
        expected = 0 if i == j else indices.nearest_distance(clusters[i], clusters[j])
        assert found.nearest_distances[i, j] == pytest.approx(expected)
    assert found.diameters == pytest.approx([indices.diameter(C) for C in clusters])
    assert found.dunn == pytest.approx(found.nearest_distances[np.triu_indices(3, 1)].min() / found.diameters.max())


def test_blocks_do_not_change_the_result(points, monkeypatch):
    X, labels = points
    whole = indices.cluster_indices(X, labels)
    monkeypatch.setattr(indices, "BLOCK", 50)
    parts = indices.cluster_indices(X, labels)
    assert parts.dunn == whole.dunn
    assert parts.average_within_distances == pytest.approx(whole.average_within_distances)
    np.testing.assert_allclose(parts.average_between_distances, whole.average_between_distances)


def test_an_offset_changes_nothing(points):
    X, labels = points
    for index in (indices.silhouette, indices.davies_bouldin, indices.dunn):
        assert index(X + 1e6, labels) == pytest.approx(index(X, labels), rel=1e-6)


def test_clusters_of_equal_or_single_points():
    X = np.array([[0.0], [0.0], [3.0], [3.0]])
    assert indices.dunn(X, np.array([0, 0, 1, 1])) == np.inf
    assert indices.dunn(X, np.array([0, 1, 0, 1])) == 0
    assert indices.silhouette(X, np.arange(4)) == 0


def test_one_cluster_around_another_is_the_worst_there_is():
    X = np.array([[-1.0], [1.0], [-2.0], [2.0]])
    assert indices.davies_bouldin(X, np.array([0, 0, 1, 1])) == np.inf


@pytest.mark.parametrize(
    ("X", "labels"),
    [
        (np.zeros((4, 2)), np.zeros(4, int)),
        (np.zeros((0, 2)), np.zeros(0, int)),
        (np.zeros((4, 2)), np.arange(3)),
        (np.zeros(4), np.arange(4)),
        (np.full((4, 2), np.nan), np.arange(4)),
    ],
)
def test_what_is_no_clustering_is_refused(X, labels):
    for index in (indices.silhouette, indices.davies_bouldin, indices.dunn, indices.cluster_indices):
        with pytest.raises(DataError) as error:
            index(X, labels)
        assert "\n" not in str(error.value)
