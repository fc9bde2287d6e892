"""Training an estimator until it is stable (§3.2.3); PCA and Birch alike."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core.arrays import Arrays, arrays_to_ragged, ragged_to_arrays
from semrl.core.errors import UsageError

Rows = NDArray[Any]


def mean_absolute_difference(before: Rows, after: Rows) -> float:
    """Return the mean of |after − before| over all numbers."""
    return float(np.abs(after - before).mean())


def label_agreement(before: Rows, after: Rows) -> float:
    """Return the balanced accuracy of the new labels, the old ones taken as truth (§3.2.3).

    Balanced accuracy is the mean, over the old labels, of the share that kept its label.
    """
    places = np.unique(before, return_inverse=True)[1]
    return float((np.bincount(places, before == after) / np.bincount(places)).mean())


@dataclass(frozen=True, kw_only=True)
class StabilityConfig:
    """When an estimator has learned enough (§3.2.3)."""

    batches: int = 250
    """Batches between the two outputs that are compared."""
    max_difference: float = 0.05
    """PCA is stable when its outputs moved by less than this on average."""
    min_agreement: float = 0.95
    """Birch is stable when the balanced accuracy of new against old labels is greater than this."""
    decisions: int = 0
    """Decisions of random play that each stage studies from its beginning, again and again, and that map and models of
    the world recall afterwards; 0: each stage plays on until it has learned, and the play is forgotten."""
    max_batches: int = 20_000
    """Training goes on to the next phase after so many batches, stable or not."""

    def __post_init__(self) -> None:
        if self.batches < 1 or self.max_batches < 1 or self.decisions < 0:
            raise UsageError("stability.batches and max_batches must be 1 or more, stability.decisions 0 or more")
        if not (self.max_difference >= 0 and 0 <= self.min_agreement <= 1):
            raise UsageError("stability.max_difference must be 0 or more, stability.min_agreement between 0 and 1")


class StabilityTest:
    """Compares, for the objects of each frame, the output of now with the output of 250 batches ago.

    Parameters
    ----------
    output
        The estimator's output for ``(n, d)`` rows.
    measure
        Compares the outputs before and after.
    is_stable
        Whether a measured value is good enough.
    batches
        How many batches lie between the two outputs.

    Attributes
    ----------
    values_ : list of float
        What was measured at each batch, from the first after ``batches`` on.
    """

    def __init__(
        self,
        output: Callable[[Rows], Rows],
        measure: Callable[[Rows, Rows], float],
        is_stable: Callable[[float], bool],
        batches: int,
    ) -> None:
        self.output = output
        self.measure = measure
        self.is_stable = is_stable
        self.batches = batches
        self.values_: list[float] = []
        self._past: deque[tuple[Rows, Rows]] = deque()

    def update(self, X: Rows) -> bool:
        """Take in the ``(n, d)`` objects that the estimator has just learned from; return whether it is stable."""
        stable = False
        if len(self._past) == self.batches:
            rows, before = self._past.popleft()
            self.values_.append(self.measure(before, self.output(rows)))
            stable = self.is_stable(self.values_[-1])
        self._past.append((X, self.output(X)))
        return stable

    def to_arrays(self) -> Arrays:
        """Return the remembered objects, their outputs and the values measured so far."""
        arrays: Arrays = {"values": np.array(self.values_)}
        if self._past:
            rows, outputs = zip(*self._past, strict=True)
            for name, part in (("rows", rows), ("outputs", outputs)):
                ragged = ragged_to_arrays(part, like=part[0][:0])
                arrays |= {f"{name}_{key}": value for key, value in ragged.items()}
        return arrays

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.values_ = arrays["values"].tolist()
        self._past.clear()
        if "rows_values" in arrays:
            rows, outputs = (
                arrays_to_ragged({key: arrays[f"{name}_{key}"] for key in ("values", "lengths")})
                for name in ("rows", "outputs")
            )
            self._past.extend(zip(rows, outputs, strict=True))
