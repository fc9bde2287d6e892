"""Mini-batch k-means: kinds of objects by the nearest of a few centres (§2.3.3), learned batch by batch."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.errors import DataError, UsageError
from semrl.core.protocols import Saved
from semrl.perception.clustering.birch import match_classes
from semrl.perception.clustering.rows import checked_rows
from semrl.perception.lloyd import k_means, nearest, sums_of, total


@dataclass(frozen=True, kw_only=True, slots=True)
class KMeansConfig:
    """Parameters of `KMeans` (§2.3.3)."""

    max_classes: int = 10
    """How many centres, each of which is a class; fewer while fewer different rows were seen."""
    start_rows: int = 5_000
    """Rows that are kept and clustered anew, all together, before centres follow batch by batch."""
    seed: int = 0
    """Of the first centres."""

    def __post_init__(self) -> None:
        if not 1 <= self.max_classes <= self.start_rows:
            raise UsageError(f"max_classes ({self.max_classes}) must be between 1 and start_rows ({self.start_rows})")
        if self.seed < 0:
            raise UsageError(f"seed must be 0 or more, not {self.seed}")


class KMeans(Saved):
    """k-means that learns batch by batch (§2.3.3; Sculley, "Web-scale k-means clustering", WWW 2010).

    The first rows are kept, and all of them are clustered anew after every batch, from first centres drawn by
    k-means++. When there were ``start_rows`` of them, and enough different ones for every centre, they are
    forgotten. From then on each row pulls its nearest centre towards itself by one over the rows that
    this centre has had. While centres are found anew, they take over the numbers of the classes with which they share
    most rows; afterwards a class is a centre, and keeps its number.

    Attributes
    ----------
    revision : object
        Another one whenever what `predict` returns may have changed.

    Examples
    --------
    >>> import numpy as np
    >>> kinds = KMeans(KMeansConfig(max_classes=2))
    >>> kinds.partial_fit(np.array([[0.0, 0.0], [0.1, 0.0], [5.0, 5.0]])).predict(np.array([[4.9, 5.0], [0.0, 0.1]]))
    array([1, 0])
    """

    SAVED = ("_centres", "_classes", "_counts", "_rows", "_weights")

    def __init__(self, config: KMeansConfig | None = None) -> None:
        self.config = config or KMeansConfig()
        self.revision = object()
        self._centres = np.zeros((0, 0))  # (k, d), those of `_classes`
        self._classes = np.zeros(0, np.int64)  # (k,) ascending
        self._counts = np.zeros(0)  # (k,) rows that each centre has had
        self._rows = np.zeros((0, 0))  # (m, d) different rows of the start
        self._weights = np.zeros(0)  # (m,) how often each of them was seen

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned."""
        return len(self._classes) > 0

    @property
    def n_clusters_(self) -> int:
        """How many centres there are."""
        return len(self._classes)

    @property
    def classes_(self) -> Ints:
        """The class numbers in use, ``(k,)`` int64, ascending, within 0 … max_classes − 1."""
        return self._classes.copy()

    @property
    def centres_(self) -> NDArray[np.float64]:
        """The centre of each of `classes_`, ``(k, d)`` float64, in the reduced space."""
        return self._centres.copy()

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Learn from ``(n, d)`` rows; zero rows are fine."""
        rows = checked_rows(X, self._centres.shape[1])
        self.revision = object()
        if len(rows) and self._is_starting:
            self._start(rows)
        elif len(rows):
            self._follow(rows)
        return self

    def predict(self, X: NDArray[Any]) -> Ints:
        """Return the class of the nearest centre for each of ``(n, d)`` rows, ``(n,)`` int64; learns nothing."""
        if not self.is_fitted:
            raise DataError("there are no centres yet: call partial_fit first")
        classes: Ints = self._classes[nearest(checked_rows(X, self._centres.shape[1]), self._centres)]
        return classes

    def _restored(self) -> None:
        sizes = {len(self._centres), len(self._classes), len(self._counts)}
        if len(sizes) > 1 or len(self._rows) != len(self._weights):
            raise DataError("the saved centres, classes and rows do not belong together")
        if len(self._classes) and not (self._classes.min() >= 0 and self._classes.max() < self.config.max_classes):
            raise DataError(f"the saved k-means has more than max_classes = {self.config.max_classes} classes")
        self.revision = object()

    @property
    def _is_starting(self) -> bool:
        return not self.is_fitted or len(self._rows) > 0

    def _start(self, rows: NDArray[np.float64]) -> None:
        """Cluster all rows so far anew; forget them when there are enough."""
        known = self._rows.reshape(-1, rows.shape[1])
        every, places = np.unique(np.concatenate([known, rows]), axis=0, return_inverse=True)
        places = places.ravel()
        weights = total(places, np.concatenate([self._weights, np.ones(len(rows))]), len(every))
        before = np.full(len(every), -1, np.int64)  # a row that is new belonged to no class
        if len(known):
            before[places[: len(known)]] = self.predict(known)
        centres = k_means(every, weights, self.config.max_classes, seed=self.config.seed)
        clusters = nearest(every, centres)
        numbers = match_classes(clusters, before, weights, self.config.max_classes)
        order = np.argsort(numbers)
        self._centres, self._classes = centres[order], numbers[order]
        self._counts = total(clusters, weights, len(centres))[order]
        enough = weights.sum() >= self.config.start_rows and len(every) >= self.config.max_classes
        self._rows, self._weights = (np.zeros((0, 0)), np.zeros(0)) if enough else (every, weights)

    def _follow(self, rows: NDArray[np.float64]) -> None:
        """Move each centre to the mean of all rows that it has had."""
        sums, counts = sums_of(rows, nearest(rows, self._centres), len(self._centres), np.ones(len(rows)))
        totals = self._counts + counts
        self._centres = self._centres + (sums - counts[:, None] * self._centres) / totals[:, None]
        self._counts = totals
