"""Birch: the leaves of a CF tree, joined to a few classes whose numbers stay what they are (§3.2.2)."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from semrl.core import Ints
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering.cf_tree import CFTree, CFTreeConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class BirchConfig:
    """Parameters of `Birch` (§3.2.2)."""

    threshold: float = 0.5
    """Largest radius of a leaf, in units of the reduced objects."""
    compact: bool = False
    """Whether an object must also lie within the threshold of its leaf's mean; else common kinds swallow rare ones."""
    branching_factor: int = 50
    """Most children of a node of the tree."""
    max_classes: int = 10
    """Most classes; leaves beyond that number are joined by Ward linkage."""
    max_leaves: int = 500
    """Most leaves (the thesis has no limit); beyond it the threshold grows. Ward linkage costs its square."""

    def __post_init__(self) -> None:
        if not 1 <= self.max_classes <= self.max_leaves:
            raise UsageError(f"max_classes ({self.max_classes}) must be between 1 and max_leaves ({self.max_leaves})")
        self.tree()

    def tree(self) -> CFTreeConfig:
        """Return the tree's part, checked."""
        return CFTreeConfig(
            threshold=self.threshold,
            compact=self.compact,
            branching_factor=self.branching_factor,
            max_leaves=self.max_leaves,
        )


class Birch:
    """Classes of objects, learned batch by batch (Zhang, Ramakrishnan & Livny, SIGMOD 1996; §3.2.2).

    Each leaf of the `CFTree` is a class as long as there are at most ``max_classes`` of them; then the leaf
    means are joined by Ward linkage, unweighted as in scikit-learn. This global step runs at the end of a
    batch that changed the set of leaves, and at no other time, so `predict` learns nothing and the classes
    depend on the batches alone. New clusters take over the numbers of the classes with which they share most
    rows, all pairs at once (Hungarian assignment); one that shares none gets the lowest free number.

    Attributes
    ----------
    revision : object
        Another one whenever what `predict` returns may have changed.
    """

    def __init__(self, config: BirchConfig | None = None) -> None:
        self.config = config or BirchConfig()
        self.revision = object()
        self._tree = CFTree(self.config.tree())
        self._ids = np.zeros(0, np.int64)  # the leaves at the last global step, ascending
        self._classes = np.zeros(0, np.int64)  # the class of each of them

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned yet."""
        return self._tree.n_leaves_ > 0

    @property
    def n_clusters_(self) -> int:
        """How many leaves the tree has."""
        return self._tree.n_leaves_

    @property
    def threshold_(self) -> float:
        """The threshold now: the configured one until ``max_leaves`` was met."""
        return self._tree.threshold_

    @property
    def leaf_classes_(self) -> Ints:
        """The class of each leaf, ``(n_clusters_,)`` int64, oldest leaf first."""
        return self._classes.copy()

    @property
    def classes_(self) -> Ints:
        """The class numbers in use, ``(k,)`` int64, ascending, within 0 … max_classes − 1."""
        return np.unique(self._classes)

    @property
    def centres_(self) -> NDArray[np.float64]:
        """The mean of the rows of each of `classes_`, ``(k, d)`` float64, in the reduced space."""
        numbers, places = np.unique(self._classes, return_inverse=True)
        counts = self._tree.leaf_counts_
        shares = np.zeros((len(numbers), len(counts)))  # (k, n_leaves)
        shares[places, np.arange(len(counts))] = counts
        shares /= shares.sum(1, keepdims=True)
        centres: NDArray[np.float64] = shares @ self._tree.leaf_means_
        return centres

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Learn from ``(n, d)`` rows, in order; zero rows are fine."""
        self._tree.partial_fit(X)
        self.revision = object()
        if not np.array_equal(self._tree.leaf_ids_, self._ids):
            self._join_leaves()
        return self

    def predict(self, X: NDArray[Any]) -> Ints:
        """Return the class of the nearest leaf for each of ``(n, d)`` rows, ``(n,)`` int64; learns nothing."""
        classes: Ints = self._classes[np.searchsorted(self._ids, self._tree.predict(X))]
        return classes

    def to_arrays(self) -> Arrays:
        """Return tree and classes; one restored from them goes on bit for bit as this one does."""
        classes = {"leaf_ids": self._ids.copy(), "leaf_classes": self._classes.copy()}
        return nest(tree=self._tree.to_arrays(), classes=classes)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured Birch returned."""
        tree = CFTree(self.config.tree())
        tree.from_arrays(unnest(arrays, "tree"))
        saved = unnest(arrays, "classes")
        if not {"leaf_ids", "leaf_classes"} <= saved.keys():
            raise DataError("the saved Birch lacks its classes")
        ids, classes = saved["leaf_ids"].copy(), saved["leaf_classes"].copy()
        if not np.array_equal(ids, tree.leaf_ids_) or classes.shape != ids.shape:
            raise DataError("the saved classes belong to other leaves than the saved tree has")
        if len(classes) and not (classes.min() >= 0 and classes.max() < self.config.max_classes):
            raise DataError(f"the saved Birch has more than max_classes = {self.config.max_classes} classes")
        self._tree, self._ids, self._classes = tree, ids, classes
        self.revision = object()

    def _join_leaves(self) -> None:
        """Do the global step and number its clusters."""
        ids = self._tree.leaf_ids_.copy()
        clusters = ward_clusters(self._tree.leaf_means_, self.config.max_classes)
        # A leaf that is new since the last step belonged to no class: -1.
        before = np.full(len(ids), -1, np.int64)
        _, now, then = np.intersect1d(ids, self._ids, assume_unique=True, return_indices=True)
        before[now] = self._classes[then]
        numbers = match_classes(clusters, before, self._tree.leaf_counts_, self.config.max_classes)
        self._ids, self._classes = ids, numbers[clusters]


def ward_clusters(means: NDArray[np.float64], most: int) -> Ints:
    """Join ``(n, d)`` means to at most `most` clusters by Ward linkage (§3.2.2).

    Returns
    -------
    ``(n,)`` int64: clusters are numbered from 0 in the order of their first members.
    """
    n = len(means)
    if n <= most:
        return np.arange(n, dtype=np.int64)
    from scipy.cluster.hierarchy import linkage

    merges = linkage(means, "ward")[: n - most, :2].astype(np.int64)  # the cheapest come first
    joined = np.repeat(np.arange(n, n + len(merges)), 2)  # merge k makes cluster n + k
    edges = coo_array((np.ones(len(joined)), (merges.ravel(), joined)), shape=(2 * n, 2 * n))
    labels = connected_components(edges, directed=False)[1][:n]
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    clusters: Ints = np.argsort(np.argsort(first))[inverse]
    return clusters


def match_classes(clusters: Ints, before: Ints, counts: NDArray[Any], most: int) -> Ints:
    """Give each cluster a class number so that as many rows as possible keep theirs.

    Parameters
    ----------
    clusters
        ``(n,)`` new cluster of each leaf, from 0.
    before
        ``(n,)`` old class number of each leaf, -1 for none.
    counts
        ``(n,)`` rows in each leaf.
    most
        Class numbers go from 0 to ``most - 1``.

    Returns
    -------
    ``(k,)`` int64: the number of each cluster, no two alike.
    """
    shared = np.zeros((clusters.max() + 1, most))  # (k, most) rows that cluster and old class share
    old = before >= 0
    np.add.at(shared, (clusters[old], before[old]), counts[old])
    rows, columns = linear_sum_assignment(shared, maximize=True)
    kept = shared[rows, columns] > 0
    numbers = np.full(len(shared), -1, np.int64)
    numbers[rows[kept]] = columns[kept]
    free = np.setdiff1d(np.arange(most), numbers)
    numbers[numbers < 0] = free[: (numbers < 0).sum()]
    return numbers
