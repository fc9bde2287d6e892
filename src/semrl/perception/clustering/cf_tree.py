"""A CF tree that learns row by row, never loses a leaf's identity and never outgrows its cap."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering.cf_kernels import LARGEST, insert_rows, nearest_leaves, sibling_radii
from semrl.perception.clustering.cf_store import (
    N_LEAVES,
    NEXT_ID,
    Features,
    Store,
    doubled,
    new_store,
    store_from_arrays,
    store_to_arrays,
)
from semrl.perception.clustering.rows import checked_rows

NO_LIMIT = np.iinfo(np.int64).max
LEAST_GROWTH = 1.05  # of the threshold at a rebuilding, so that a series of them ends


@dataclass(frozen=True, kw_only=True, slots=True)
class CFTreeConfig:
    """Parameters of a `CFTree` (§3.2.2; §3.4.1 for the state map)."""

    threshold: float = 0.5
    """Largest radius ``sqrt(S / n)`` of a leaf, in units of the data; it grows when `max_leaves` is met."""
    branching_factor: int = 50
    """Most children of a node, at least 2."""
    compact: bool = False
    """Whether a row must also lie within the threshold of the mean of the leaf it joins. The radius alone hardly grows
    when a leaf of many rows takes in a distant one, so common kinds swallow rare neighbours."""
    max_leaves: int | None = None
    """Most leaves, or None for no limit."""

    def __post_init__(self) -> None:
        if not 0 <= self.threshold <= LARGEST:
            raise UsageError(f"threshold must be a finite number of at least 0, not {self.threshold}")
        if self.branching_factor < 2:
            raise UsageError(f"branching_factor must be at least 2, not {self.branching_factor}")
        if self.max_leaves is not None and self.max_leaves < 1:
            raise UsageError(f"max_leaves must be at least 1 or None, not {self.max_leaves}")


class CFTree:
    """The leaves of BIRCH, learned row by row over BETULA's cluster features.

    A row goes down to the child with the nearest mean. At the bottom it joins the nearest leaf when the
    merged radius stays within the threshold, else it founds a new leaf; a node with too many children is
    split between its two farthest ones. (Zhang, Ramakrishnan & Livny, "BIRCH", SIGMOD 1996; Lang & Schubert,
    "BETULA: Numerically Stable CF-Trees for BIRCH Clustering", SISAP 2020.)

    A leaf gets an integer id when it is founded. Ids ascend, never change and are never used again. With more
    than ``max_leaves``, the threshold rises to the median radius that leaves would have if merged with their
    nearest sibling, and all leaves are inserted anew, oldest first. Of two that merge the older id lives on,
    and `resolve` knows what became of the other.

    Notes
    -----
    The result depends on the order of the rows, but not on how they are cut into batches.
    """

    def __init__(self, config: CFTreeConfig | None = None) -> None:
        self.config = config or CFTreeConfig()
        self._store = self._new_store(0, self.config.threshold)  # dimension 0: no row seen yet
        self._absorbed_ids = np.zeros(0, np.int64)  # ascending
        self._absorbed_by = np.zeros(0, np.int64)

    @property
    def threshold_(self) -> float:
        """The threshold now, in units of the data."""
        return float(self._store.threshold[0])

    @property
    def n_features_in_(self) -> int:
        """How many numbers a row has; 0 before the first row."""
        return int(self._store.leaves.means.shape[1])

    @property
    def n_leaves_(self) -> int:
        """How many leaves there are."""
        return int(self._store.counters[N_LEAVES])

    @property
    def leaf_ids_(self) -> Ints:
        """Ids of the leaves, ``(n_leaves_,)`` int64, ascending: a read-only view of live memory."""
        return self._view(self._store.leaf_ids)

    @property
    def leaf_means_(self) -> NDArray[np.float64]:
        """Means, ``(n_leaves_, d)`` float64: a read-only view of live memory, so copy what you keep."""
        return self._view(self._store.leaves.means)

    @property
    def leaf_counts_(self) -> Ints:
        """Rows in each leaf, ``(n_leaves_,)`` int64: a read-only view of live memory."""
        return self._view(self._store.leaves.counts)

    @property
    def leaf_radii_(self) -> NDArray[np.float64]:
        """Radii ``sqrt(S / n)`` of the leaves, ``(n_leaves_,)`` float64, in units of the data."""
        radii: NDArray[np.float64] = np.sqrt(self._view(self._store.leaves.deviations) / self.leaf_counts_)
        return radii

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Learn from ``(n, d)`` rows, in order.

        Raises
        ------
        DataError
            Rows are not finite, or not as long as those seen before; nothing is learned then.
        """
        self.insert(X)
        return self

    def insert(self, X: NDArray[Any]) -> Ints:
        """Learn from ``(n, d)`` rows and return the id of the leaf that each one joined, ``(n,)`` int64.

        Where another leaf absorbed that one before the last row was in, the id is the survivor's.

        Raises
        ------
        DataError
            As `partial_fit`.
        """
        X = checked_rows(X, self.n_features_in_)
        n, done = len(X), 0
        if n and not self.n_features_in_:
            self._store = self._new_store(X.shape[1], self.threshold_)
        rows = Features(X, np.ones(n, np.int64), np.zeros(n))
        ids = np.empty(n, np.int64)
        most = NO_LIMIT if self.config.max_leaves is None else self.config.max_leaves
        while done < n:
            done = self._insert_rows(rows, done, most, ids)
            while self.n_leaves_ > most:
                self._rebuild()
                ids[:done] = self.resolve(ids[:done])
        return ids

    def predict(self, X: NDArray[Any]) -> Ints:
        """Return the id of the leaf with the nearest mean for each of ``(n, d)`` rows, ``(n,)`` int64.

        All leaves are compared, whatever way the tree would send the row.

        Raises
        ------
        DataError
            Nothing was learned yet, or as `partial_fit`.
        """
        return self._query(X, exact=True)

    def predict_by_descent(self, X: NDArray[Any]) -> Ints:
        """Return the id of the leaf that a descent from the root finds, ``(n,)`` int64.

        Much cheaper than `predict` in a large tree; not always the nearest leaf, though one close by.

        Raises
        ------
        DataError
            As `predict`.
        """
        return self._query(X, exact=False)

    def resolve(self, ids: NDArray[Any]) -> Ints:
        """Return the living leaf for each id ever given out: itself, or the one that absorbed it.

        Raises
        ------
        DataError
            An id was never given out.
        """
        resolved = np.array(ids, np.int64)
        end = self._store.counters[NEXT_ID]
        if resolved.size and (resolved.min() < 0 or resolved.max() >= end):
            raise DataError(f"only leaf ids below {end} were given out so far")
        if len(self._absorbed_ids):
            place = np.searchsorted(self._absorbed_ids, resolved).clip(max=len(self._absorbed_ids) - 1)
            resolved = np.where(self._absorbed_ids[place] == resolved, self._absorbed_by[place], resolved)
        return resolved

    def to_arrays(self) -> Arrays:
        """Return the whole tree; one restored from it goes on bit for bit as this one does."""
        absorbed = {"absorbed_ids": self._absorbed_ids.copy(), "absorbed_by": self._absorbed_by.copy()}
        return store_to_arrays(self._store) | absorbed

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured tree returned."""
        if not {"absorbed_ids", "absorbed_by"} <= arrays.keys():
            raise DataError("the saved CF tree lacks absorbed_ids or absorbed_by")
        self._store = store_from_arrays(arrays, self.config.branching_factor)
        self._absorbed_ids, self._absorbed_by = arrays["absorbed_ids"].copy(), arrays["absorbed_by"].copy()

    def _new_store(self, dimension: int, threshold: float) -> Store:
        reach = threshold if self.config.compact else np.inf
        return new_store(dimension, self.config.branching_factor, threshold, reach=reach)

    def _view(self, array: NDArray[Any]) -> NDArray[Any]:
        view = array[: self.n_leaves_]
        view.flags.writeable = False
        return view

    def _query(self, X: NDArray[Any], *, exact: bool) -> Ints:
        if not self.n_leaves_:
            raise DataError("there are no leaves yet: call partial_fit first")
        found: Ints = self._store.leaf_ids[nearest_leaves(self._store, checked_rows(X, self.n_features_in_), exact)]
        return found

    def _insert_rows(self, rows: Features, start: int, most: int, ids: Ints) -> int:
        """Insert from `start` on, making room as needed, until all are in or `most` leaves are passed."""
        while True:
            start = insert_rows(self._store, rows, start, most, ids)
            if start == len(ids) or self.n_leaves_ > most:
                return start
            self._store = doubled(self._store)

    def _rebuild(self) -> None:
        """Raise the threshold and insert all leaves anew, oldest first."""
        old, n = self._store, self.n_leaves_
        threshold = max(float(np.median(sibling_radii(old))), LEAST_GROWTH * self.threshold_, 1 / LARGEST)
        self._store = self._new_store(self.n_features_in_, threshold)
        leaves = Features(old.leaves.means[:n], old.leaves.counts[:n], old.leaves.deviations[:n])
        places = np.empty(n, np.int64)  # rows of the new tree, which are its ids as long as we do not set them
        self._insert_rows(leaves, 0, NO_LIMIT, places)
        survivors = old.leaf_ids[np.unique(places, return_index=True)[1]]
        self._store.leaf_ids[: len(survivors)] = survivors
        self._store.counters[NEXT_ID] = old.counters[NEXT_ID]
        self._note_absorbed(old.leaf_ids[:n], survivors[places])

    def _note_absorbed(self, ids: Ints, owners: Ints) -> None:
        """Write down which ids just went over to others, and follow those that had gone before."""
        gone = ids != owners
        absorbed = np.concatenate([self._absorbed_ids, ids[gone]])
        by = np.concatenate([owners[np.searchsorted(ids, self._absorbed_by)], owners[gone]])
        order = np.argsort(absorbed)
        self._absorbed_ids, self._absorbed_by = absorbed[order], by[order]
