"""How good a clustering is: validation indices of §2.3.2 and §4.1.2, as pure functions.

Points are rows, distances are Euclidean, in units of the data. The averages carry the factor 1/(2|N|) as the
thesis prints it, where we read N as the points concerned; so those over pairs grow with the number of points.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist, pdist
from sklearn.metrics import davies_bouldin_score, silhouette_score

from semrl.core.errors import DataError

Points = NDArray[np.floating[Any]]
Labels = NDArray[np.integer[Any]]

BLOCK = 2**21  # distances held at once (16 MB)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ClusterIndices:
    """All indices of one clustering with ``k`` clusters (§2.3.2, §4.1.2).

    Attributes
    ----------
    labels
        ``(k,)`` the clusters, ascending: rows and columns of the others.
    silhouette, davies_bouldin, dunn
        Of the clustering as a whole.
    diameters, average_within_distances, average_centroid_distances
        ``(k,)`` float64, compactness of each cluster.
    nearest_distances, average_between_distances, centroid_distances
        ``(k, k)`` float64, separation of each two clusters; symmetric, 0 on the diagonal.
    """

    labels: Labels
    silhouette: float
    davies_bouldin: float
    dunn: float
    diameters: NDArray[np.float64]
    average_within_distances: NDArray[np.float64]
    average_centroid_distances: NDArray[np.float64]
    nearest_distances: NDArray[np.float64]
    average_between_distances: NDArray[np.float64]
    centroid_distances: NDArray[np.float64]


def diameter(C: Points) -> float:
    """Return diam(C) = max d(u, w) over u, w ∈ C, for ``(n, d)`` points."""
    C = np.unique(C, axis=0)  # many objects look exactly alike
    return max(float(block.max()) for block in _distances(C, C))


def average_within_distance(C: Points) -> float:
    """Return W(C) = 1/(2|C|) Σ d(u, w) over all ordered pairs u, w ∈ C."""
    return sum(float(block.sum()) for block in _distances(C, C)) / (2 * len(C))


def average_centroid_distance(C: Points) -> float:
    """Return W(C) = 1/(2|C|) Σ d(u, c) over u ∈ C, c being the centroid of C."""
    return float(cdist(C, C.mean(0, keepdims=True)).sum()) / (2 * len(C))


def nearest_distance(C1: Points, C2: Points) -> float:
    """Return dist(C₁, C₂) = min d(u, w) over u ∈ C₁, w ∈ C₂."""
    C1, C2 = np.unique(C1, axis=0), np.unique(C2, axis=0)
    return min(float(block.min()) for block in _distances(C1, C2))


def average_between_distance(C1: Points, C2: Points) -> float:
    """Return W(C₁, C₂) = 1/(2|N|) Σ d(u, w) over u ∈ C₁, w ∈ C₂, with |N| = |C₁| + |C₂|."""
    return sum(float(block.sum()) for block in _distances(C1, C2)) / (2 * (len(C1) + len(C2)))


def centroid_distance(C1: Points, C2: Points) -> float:
    """Return d(c₁, c₂), the distance of the two centroids."""
    return float(np.linalg.norm(C1.mean(0) - C2.mean(0)))


def silhouette(X: Points, labels: Labels) -> float:
    """Return the mean silhouette, −1 … 1, higher is better (scikit-learn's; Rousseeuw 1987).

    Raises
    ------
    DataError
        There are fewer than two clusters, or the arrays do not fit.
    """
    X, labels, numbers = _checked(X, labels)
    if len(numbers) == len(X):
        return 0.0  # by definition, for clusters of one point
    return float(silhouette_score(X, labels))


def davies_bouldin(X: Points, labels: Labels) -> float:
    """Return the Davies–Bouldin index, from 0, lower is better (scikit-learn's; Davies & Bouldin 1979).

    Infinite when two centroids coincide.

    Raises
    ------
    DataError
        As `silhouette`.
    """
    X, labels, numbers = _checked(X, labels)
    centroids = np.stack([X[labels == number].mean(0) for number in numbers])
    if pdist(centroids).min() <= 1e-12 * np.abs(X).max():
        return math.inf
    return float(davies_bouldin_score(X, labels))


def dunn(X: Points, labels: Labels) -> float:
    """Return the Dunn index min dist(Cᵢ, Cⱼ) / max diam(Cₐ), from 0, higher is better (§2.3.2, §4.1.2).

    Infinite when all clusters are single points, 0 when two clusters share a point.

    Raises
    ------
    DataError
        As `silhouette`.
    """
    clusters = _clusters(X, labels)
    return _dunn(_each(diameter, clusters), _each_two(nearest_distance, clusters))


def cluster_indices(X: Points, labels: Labels) -> ClusterIndices:
    """Return all indices of a clustering.

    Parameters
    ----------
    X
        ``(n, d)`` points.
    labels
        ``(n,)`` integers, the cluster of each point.

    Raises
    ------
    DataError
        As `silhouette`.
    """
    clusters = _clusters(X, labels)
    diameters, nearest = _each(diameter, clusters), _each_two(nearest_distance, clusters)
    return ClusterIndices(
        labels=np.unique(labels),
        silhouette=silhouette(X, labels),
        davies_bouldin=davies_bouldin(X, labels),
        dunn=_dunn(diameters, nearest),
        diameters=diameters,
        average_within_distances=_each(average_within_distance, clusters),
        average_centroid_distances=_each(average_centroid_distance, clusters),
        nearest_distances=nearest,
        average_between_distances=_each_two(average_between_distance, clusters),
        centroid_distances=_each_two(centroid_distance, clusters),
    )


def _dunn(diameters: NDArray[np.float64], nearest: NDArray[np.float64]) -> float:
    separation = nearest[np.triu_indices(len(nearest), 1)].min()
    if separation == 0:
        return 0.0
    return float(separation / diameters.max()) if diameters.max() > 0 else np.inf


def _each(measure: Callable[[Points], float], clusters: list[Points]) -> NDArray[np.float64]:
    return np.array([measure(C) for C in clusters])


def _each_two(measure: Callable[[Points, Points], float], clusters: list[Points]) -> NDArray[np.float64]:
    table = np.zeros((len(clusters), len(clusters)))
    for i, j in combinations(range(len(clusters)), 2):
        table[i, j] = table[j, i] = measure(clusters[i], clusters[j])
    return table


def _distances(A: Points, B: Points) -> Iterator[NDArray[np.float64]]:
    """Yield the distances between all rows of A and B, some rows of A at a time."""
    rows = max(1, BLOCK // len(B))
    for start in range(0, len(A), rows):
        yield cdist(A[start : start + rows], B)


def _clusters(X: Points, labels: Labels) -> list[Points]:
    X, labels, numbers = _checked(X, labels)
    return [X[labels == number] for number in numbers]


def _checked(X: Points, labels: Labels) -> tuple[NDArray[np.float64], Labels, Labels]:
    """Return points around the origin, where dot products are exact enough, labels, and the clusters."""
    X, labels = np.asarray(X, dtype=np.float64), np.asarray(labels)
    if X.ndim != 2 or labels.shape != X.shape[:1]:
        raise DataError(f"expected (n, d) points and (n,) labels, got {X.shape} and {labels.shape}")
    numbers = np.unique(labels)
    if len(numbers) < 2:
        raise DataError(f"validation indices need at least two clusters, got {len(numbers)}")
    if not np.isfinite(X).all():
        raise DataError("every number must be finite")
    return X - X.mean(0), labels, numbers
