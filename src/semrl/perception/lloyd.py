"""k-means of weighted rows (§2.3.3), to the same bits with any number of threads; for objects and for pixels."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from semrl.core import Ints

Rows = NDArray[np.float64]

MOST_ITERATIONS = 100


def k_means(X: Rows, weights: NDArray[np.float64], k: int, *, seed: int = 0, starts: int = 4) -> Rows:
    """Return the centres with the least weighted sum of squared distances, of several starts.

    The first centres are drawn by k-means++ (Arthur & Vassilvitskii, SODA 2007), then Lloyd's two steps alternate
    until no row changes its cluster (§2.3.3, steps 2 to 4).

    Parameters
    ----------
    X
        ``(n, d)`` rows, n at least 1, no two alike.
    weights
        ``(n,)``, how often each row counts, above 0.
    k
        How many centres.
    seed
        Of the first start; the others take the seeds after it.
    starts
        How often to begin anew.

    Returns
    -------
    ``(m, d)``: k centres, or fewer where there are fewer rows.
    """
    if len(X) <= k:
        return X.copy()
    from sklearn.cluster import kmeans_plusplus

    found = []
    for start in range(seed, seed + starts):
        first, _ = kmeans_plusplus(X, k, sample_weight=weights, random_state=start)
        centres = _lloyd(X, weights, first)
        found.append((float(weights @ cdist(X, centres, "sqeuclidean").min(axis=1)), centres))
    return min(found, key=lambda pair: pair[0])[1]


def nearest(X: Rows, centres: Rows) -> Ints:
    """Return which of ``(k, d)`` centres is nearest to each of ``(n, d)`` rows, ``(n,)``; the first of equal ones."""
    places: Ints = cdist(X, centres, "sqeuclidean").argmin(axis=1)
    return places


def sums_of(X: Rows, places: Ints, k: int, weights: NDArray[np.float64]) -> tuple[Rows, NDArray[np.float64]]:
    """Return the weighted sum of the rows at each of k places, ``(k, d)``, and the weights there, ``(k,)``."""
    columns = [total(places, weights * column, k) for column in X.T]
    return np.stack(columns, axis=1), total(places, weights, k)


def total(places: Ints, weights: NDArray[np.float64], k: int) -> NDArray[np.float64]:
    """Return the sum of the weights at each of k places, ``(k,)``, added in their order."""
    return np.asarray(np.bincount(places, weights, k), dtype=np.float64)


def _lloyd(X: Rows, weights: NDArray[np.float64], centres: Rows) -> Rows:
    """Alternate Lloyd's steps; a centre that loses all its rows is dropped."""
    places = nearest(X, centres)
    for _ in range(MOST_ITERATIONS):
        sums, totals = sums_of(X, places, len(centres), weights)
        used = totals > 0
        centres = sums[used] / totals[used, None]
        before, places = places, nearest(X, centres)
        if used.all() and np.array_equal(before, places):
            break
    return centres
