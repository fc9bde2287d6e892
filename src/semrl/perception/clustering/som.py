"""A self-organising map: kinds of objects by the units of a small grid, joined to a few classes (§1)."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.errors import DataError, UsageError
from semrl.core.kernels import compiled
from semrl.core.protocols import Saved
from semrl.perception.clustering.birch import match_classes, ward_clusters
from semrl.perception.clustering.rows import checked_rows
from semrl.perception.lloyd import nearest, sums_of


@dataclass(frozen=True, kw_only=True, slots=True)
class SelfOrganisingMapConfig:
    """Parameters of `SelfOrganisingMap`."""

    rows: int = 6
    """Rows of the grid of units."""
    columns: int = 6
    """Columns of the grid."""
    max_classes: int = 10
    """Most classes; units beyond that number are joined by Ward linkage."""
    learning_rate: float = 0.5
    """Share of the way to a row that its unit moves, at the beginning."""
    final_learning_rate: float = 0.01
    """The same after `decay_rows`."""
    radius: float = 3.0
    """Standard deviation of the neighbourhood at the beginning, in steps of the grid."""
    final_radius: float = 0.3
    """The same after `decay_rows`."""
    decay_rows: int = 10_000
    """Rows during which learning rate and neighbourhood fall exponentially; then they stay."""
    seed: int = 0
    """Of the rows where units begin."""

    def __post_init__(self) -> None:
        if min(self.rows, self.columns, self.decay_rows) < 1:
            raise UsageError("rows, columns and decay_rows must all be 1 or more")
        if not 1 <= self.max_classes <= self.rows * self.columns:
            raise UsageError(f"max_classes ({self.max_classes}) must be between 1 and the number of units")
        if not 0 < self.final_learning_rate <= self.learning_rate <= 1:
            raise UsageError(
                "learning_rate and final_learning_rate must lie in 0 … 1, the final one not above the other"
            )
        if not 0 < self.final_radius <= self.radius < np.inf:
            raise UsageError("radius and final_radius must be above 0, the final one not above the other")
        if self.seed < 0:
            raise UsageError(f"seed must be 0 or more, not {self.seed}")


class SelfOrganisingMap(Saved):
    """Units on a rectangular grid that learn row by row (Kohonen, "Self-organized formation of topologically correct
    feature maps", Biological Cybernetics 43, 1982).

    Each row pulls the nearest unit towards itself, and the others the less, the farther they are from that one on the
    grid: by a Gaussian. Units that have won rows are classes as long as there are at most ``max_classes``
    of them; then they are joined by Ward linkage at the end of each batch. Classes keep their numbers as
    those of `Birch` do.

    Attributes
    ----------
    revision : object
        Another one whenever what `predict` returns may have changed.

    Examples
    --------
    >>> import numpy as np
    >>> line = np.linspace(0, 1, 2_000)[:, None]
    >>> config = SelfOrganisingMapConfig(rows=1, columns=5, max_classes=2, decay_rows=2_000)
    >>> som = SelfOrganisingMap(config).partial_fit(np.random.default_rng(0).permutation(line))
    >>> len(set(som.predict(line[:500]).tolist()))
    1
    """

    SAVED = ("_units", "_counts", "_classes", "_learned")

    def __init__(self, config: SelfOrganisingMapConfig | None = None) -> None:
        self.config = config or SelfOrganisingMapConfig()
        self.revision = object()
        self._units = np.zeros((0, 0))  # (u, d)
        self._counts = np.zeros(0)  # (u,) rows that each unit won
        self._classes = np.zeros(0, np.int64)  # (u,) −1 for a unit that won none
        self._learned = 0  # rows so far

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned."""
        return len(self._units) > 0

    @property
    def n_clusters_(self) -> int:
        """How many units have won rows."""
        return int((self._classes >= 0).sum())

    @property
    def units_(self) -> NDArray[np.float64]:
        """The units, ``(rows, columns, d)`` float64, in the reduced space.

        Raises
        ------
        DataError
            Nothing was learned yet.
        """
        self._check_fitted()
        return self._units.reshape(self.config.rows, self.config.columns, -1).copy()

    @property
    def classes_(self) -> Ints:
        """The class numbers in use, ``(k,)`` int64, ascending, within 0 … max_classes − 1."""
        return np.unique(self._classes[self._classes >= 0])

    @property
    def centres_(self) -> NDArray[np.float64]:
        """The mean of the units of each of `classes_`, by the rows they won, ``(k, d)`` float64."""
        won = self._classes >= 0
        _, places = np.unique(self._classes[won], return_inverse=True)
        sums, counts = sums_of(self._units[won], places, len(self.classes_), self._counts[won])
        return sums / counts[:, None]

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Learn from ``(n, d)`` rows, in order; zero rows are fine."""
        rows = checked_rows(X, self._units.shape[1])
        self.revision = object()
        if not len(rows):
            return self
        config = self.config
        if not self.is_fitted:
            n_units = config.rows * config.columns
            self._units = rows[np.random.default_rng(config.seed).integers(len(rows), size=n_units)]
            self._counts, self._classes = np.zeros(n_units), np.full(n_units, -1, np.int64)
        _pull(self._units, self._counts, config.columns, rows, self._pace(len(rows)))
        self._learned += len(rows)
        self._join_units()
        return self

    def predict(self, X: NDArray[Any]) -> Ints:
        """Return the class of the best-matching unit for each of ``(n, d)`` rows, ``(n,)`` int64; learns nothing."""
        self._check_fitted()
        won = self._classes >= 0
        classes: Ints = self._classes[won][nearest(checked_rows(X, self._units.shape[1]), self._units[won])]
        return classes

    def _restored(self) -> None:
        n_units, classes = self.config.rows * self.config.columns, self._classes
        if len(self._units) not in (0, n_units):
            raise DataError(f"the saved map has {len(self._units)} units, not {n_units}")
        if self._counts.shape != classes.shape or len(self._units) != len(classes):
            raise DataError("the saved units and classes do not belong together")
        if len(classes) and not (classes.min() >= -1 and classes.max() < self.config.max_classes):
            raise DataError(f"the saved map has more than max_classes = {self.config.max_classes} classes")
        self.revision = object()

    def _check_fitted(self) -> None:
        if not self.is_fitted:
            raise DataError("there are no units yet: call partial_fit first")

    def _pace(self, n: int) -> NDArray[np.float64]:
        """Return learning rate and neighbourhood for each of the next rows, ``(n, 2)``."""
        config = self.config
        elapsed = np.minimum((self._learned + np.arange(n)) / config.decay_rows, 1)
        rates = config.learning_rate * (config.final_learning_rate / config.learning_rate) ** elapsed
        radii = config.radius * (config.final_radius / config.radius) ** elapsed
        return np.stack([rates, radii], axis=1)

    def _join_units(self) -> None:
        """Join the units that have won rows, and number the classes."""
        won = self._counts > 0
        clusters = ward_clusters(self._units[won], self.config.max_classes)
        numbers = match_classes(clusters, self._classes[won], self._counts[won], self.config.max_classes)
        self._classes = np.full(len(won), -1, np.int64)
        self._classes[won] = numbers[clusters]


@compiled
def _pull(
    units: NDArray[np.float64],
    counts: NDArray[np.float64],
    columns: int,
    rows: NDArray[np.float64],
    pace: NDArray[np.float64],
) -> None:
    """Let each row pull its unit and, less, the neighbours of that one on the grid; all in place."""
    for i in range(len(rows)):
        winner, least = 0, np.inf
        for u in range(len(units)):
            distance = 0.0
            for k in range(rows.shape[1]):
                distance += (rows[i, k] - units[u, k]) ** 2
            if distance < least:
                winner, least = u, distance
        counts[winner] += 1
        rate, radius = pace[i]
        for u in range(len(units)):
            steps = (u // columns - winner // columns) ** 2 + (u % columns - winner % columns) ** 2
            share = rate * np.exp(-steps / (2 * radius**2))
            for k in range(rows.shape[1]):
                units[u, k] += share * (rows[i, k] - units[u, k])
