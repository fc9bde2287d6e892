"""What every clusterer asks of the rows that it is given."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core.errors import DataError
from semrl.perception.clustering.cf_kernels import LARGEST, usable


def checked_rows(X: NDArray[Any], dimension: int) -> NDArray[np.float64]:
    """Return ``(n, d)`` rows as contiguous float64.

    Parameters
    ----------
    X
        Numbers of any type, ``(n, d)``; n may be 0.
    dimension
        What d has to be; 0 when no row was seen before.

    Raises
    ------
    DataError
        These are no rows of numbers, they are not as long as expected, or not all finite and small enough to be
        squared.
    """
    rows = np.asarray(X)
    if rows.ndim != 2 or rows.shape[1] == 0 or rows.dtype.kind not in "biuf":
        raise DataError(f"expected numbers of shape (n, d), got {rows.dtype} of shape {rows.shape}")
    if dimension not in (0, rows.shape[1]):
        raise DataError(f"expected rows of {dimension} numbers, got rows of {rows.shape[1]}")
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    if not usable(rows):
        raise DataError(f"every number must be finite and at most {LARGEST:g} in size")
    return rows
