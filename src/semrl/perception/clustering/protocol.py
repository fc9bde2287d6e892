"""What a clusterer must offer."""

from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.protocols import Persistent


class Clusterer(Persistent, Protocol):
    """Tells which objects are of one class (§3.2.2)."""

    revision: object
    """Another one whenever what `predict` returns may have changed."""

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned yet."""
        ...

    @property
    def n_clusters_(self) -> int:
        """How many clusters there are before they are joined to classes."""
        ...

    @property
    def classes_(self) -> Ints:
        """The class numbers in use, ``(k,)`` int64, ascending."""
        ...

    @property
    def centres_(self) -> NDArray[np.float64]:
        """The mean of each of `classes_`, ``(k, d)``, in the reduced space."""
        ...

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Learn from ``(n, d)`` reduced objects; n may be 0.

        Raises
        ------
        DataError
            Rows are not finite, or not as long as those seen before; nothing is learned then.
        """
        ...

    def predict(self, X: NDArray[Any]) -> Ints:
        """Return the class of each of ``(n, d)`` reduced objects, ``(n,)`` int64; learns nothing.

        Raises
        ------
        DataError
            Nothing was learned yet, or as `partial_fit`.
        """
        ...
