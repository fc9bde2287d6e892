"""Incremental principal component analysis of objects (§3.2.2)."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, UsageError
from semrl.core.kernels import compiled

_LEARNED = (
    "components_", "mean_", "var_", "singular_values_", "explained_variance_",
    "explained_variance_ratio_", "noise_variance_", "n_samples_seen_",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class PCAConfig:
    """How objects are reduced."""

    components: int = 10
    """Numbers that describe an object after reduction."""

    def __post_init__(self) -> None:
        if self.components < 1:
            raise UsageError(f"components must be 1 or more, not {self.components}")


class ObjectPCA:
    """scikit-learn's incremental PCA (Ross et al. 2008), fed with the unique objects of each frame.

    Only unique objects are learned, so that rare ones are reconstructed as well (§3.2.3). Since the
    decomposition needs at least as many rows as components, rows wait until there are enough.

    Attributes
    ----------
    n_updates_ : int
        How many times the decomposition was updated.
    revision : object
        Another one whenever what `transform` returns may have changed.
    """

    def __init__(self, config: PCAConfig | None = None) -> None:
        self.config = config or PCAConfig()
        self.n_updates_ = 0
        self.revision = object()
        self._pca: Any = SimpleNamespace()  # what was learned, and with what, once something is
        self._waiting: NDArray[np.float64] | None = None

    @property
    def dimension(self) -> int:
        """How many numbers describe an object."""
        return self.config.components

    @property
    def is_fitted(self) -> bool:
        """Whether rows can be transformed."""
        return self.n_updates_ > 0

    @property
    def explained_variance_ratio_(self) -> NDArray[np.float64]:
        """Share of the variance that each component explains, ``(k,)``."""
        self._check_fitted()
        return np.asarray(self._pca.explained_variance_ratio_)

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Learn from the unique rows among ``(n, d)``."""
        self._check_rows(X)
        rows = np.unique(np.asarray(X, dtype=np.float64), axis=0)
        self._waiting = rows if self._waiting is None else np.concatenate([self._waiting, rows])
        if len(self._waiting) >= self.config.components:
            with np.errstate(invalid="ignore"):  # of objects that are all alike no component explains any share
                self._pca = self._learning().partial_fit(self._waiting)
            # Memory order decides the last bit of a product: keep the one that a restored estimator has.
            self._pca.components_ = np.ascontiguousarray(self._pca.components_)
            self._waiting = None
            self.n_updates_ += 1
            self.revision = object()
        return self

    def transform(self, X: NDArray[Any]) -> Floats:
        """Project ``(n, d)`` rows on the components, ``(n, k)`` float32."""
        self._check_fitted()
        self._check_rows(X)
        rows = np.ascontiguousarray(X, dtype=np.float64)
        return project(rows, self._pca.mean_, self._pca.components_)

    def inverse_transform(self, Z: NDArray[Any]) -> Floats:
        """Map ``(n, k)`` back to objects, ``(n, d)``, for looking at them."""
        self._check_fitted()
        return np.asarray(Z @ self._pca.components_ + self._pca.mean_, dtype=np.float32)

    def to_arrays(self) -> Arrays:
        """Return the decomposition and the waiting rows."""
        learned = {name: np.asarray(getattr(self._pca, name)) for name in _LEARNED} if self.is_fitted else {}
        waiting = {} if self._waiting is None else {"waiting": self._waiting}
        return {"n_updates": np.array(self.n_updates_), **learned, **waiting}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over a decomposition."""
        self.n_updates_ = int(arrays["n_updates"])
        self.revision = object()
        self._waiting = arrays.get("waiting")
        learned = {name: arrays[name] for name in (_LEARNED if self.is_fitted else ())}
        self._pca = SimpleNamespace(**{name: x[()] if x.ndim == 0 else x for name, x in learned.items()})

    def _learning(self) -> Any:
        """Return scikit-learn's estimator with what was learned so far; who only transforms need not wait for it."""
        from sklearn.decomposition import IncrementalPCA

        if isinstance(self._pca, IncrementalPCA):
            return self._pca
        pca = IncrementalPCA(n_components=self.config.components)
        vars(pca).update(vars(self._pca))
        if self.is_fitted:
            pca.n_components_, pca.batch_size_ = self.config.components, None
        return pca

    def _check_rows(self, X: NDArray[Any]) -> None:
        if X.ndim != 2 or not np.isfinite(X).all():
            raise DataError(f"expected rows (n, d) of finite numbers, got {X.shape} of {X.dtype}")
        known = self._pca.components_ if self.is_fitted else X if self._waiting is None else self._waiting
        if X.shape[1] != known.shape[1] or X.shape[1] < self.config.components:
            raise DataError(
                f"rows of {X.shape[1]} numbers do not fit {self.config.components} components of "
                f"{known.shape[1]} numbers"
            )

    def _check_fitted(self) -> None:
        if not self.is_fitted:
            raise DataError(f"PCA has not seen {self.config.components} objects yet: call partial_fit first")


@compiled
def project(X: NDArray[np.float64], mean: NDArray[np.float64], components: NDArray[np.float64]) -> Floats:
    """Return ``(X - mean) @ components.T`` with each sum in its order.

    A library's product of matrices sums in another order for other numbers of rows and threads; an object's numbers
    must not depend on what else is in the frame.
    """
    columns = components.T.copy()  # (d, k)
    projected = np.empty((len(X), len(components)), np.float32)
    totals = np.empty(len(components))
    for i in range(len(X)):
        totals[:] = 0
        for j in range(len(columns)):
            deviation = X[i, j] - mean[j]
            for k in range(len(totals)):
                totals[k] += deviation * columns[j, k]
        projected[i] = totals
    return projected
