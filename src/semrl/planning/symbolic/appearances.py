"""How cells look beside one another: the same shape in other colours, and one thing drawn over another."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Shape = bytes
"""Between which pixels of a cell the colour changes, whatever colours these are; empty where it never does."""


class Appearances:
    """How kinds of cells look.

    Parameters
    ----------
    patterns
        ``(side, side, 3)`` uint8 of each kind; may grow later.
    """

    def __init__(self, patterns: Sequence[NDArray[np.uint8]]) -> None:
        self._patterns = patterns
        self._shapes: dict[int, Shape] = {}

    def shape(self, kind: int) -> Shape:
        """Return the shape of a kind: the same for all that differ in colours or light only."""
        if kind not in self._shapes:
            pattern = self._patterns[kind]
            across, down = pattern[:, 1:] != pattern[:, :-1], pattern[1:] != pattern[:-1]
            edges = np.concatenate([across.any(axis=-1).ravel(), down.any(axis=-1).ravel()])
            self._shapes[kind] = np.packbits(edges).tobytes() if edges.any() else b""
        return self._shapes[kind]

    def most_alike(self, kind: int, among: Iterable[int]) -> int:
        """Return the kind of some that has most pixels in common with another; the first of equals."""
        pattern = self._patterns[kind]
        return max(sorted(among), key=lambda one: int((self._patterns[one] == pattern).all(axis=-1).sum()))
