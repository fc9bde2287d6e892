"""Worlds that are drawn cell by cell: how large a cell is, and which appearances of cells there are.

The side of a cell is the one with which the frames are said in the fewest bits (minimum description length, Rissanen
1978): every appearance once, and of each cell which one it has.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semrl.core import Image, Ints
from semrl.core.arrays import Arrays
from semrl.core.errors import UsageError

MAX_KINDS = 250
"""Appearances of cells, beyond which a world is not drawn cell by cell."""

_FEWEST_CELLS = 3
_PIXEL_BITS = 24


class Lattice:
    """Reads frames as tables of cells, each of a kind: all that look alike are of one.

    Attributes
    ----------
    side_px_ : int
        Side of a cell; 0 before `fit`.
    patterns_ : list of ndarray
        ``(side, side, 3)`` uint8, how each kind looks.
    """

    def __init__(self) -> None:
        self.side_px_ = 0
        self.patterns_: list[NDArray[np.uint8]] = []
        self._kinds: dict[bytes, int] = {}

    def fit(self, frames: Sequence[Image]) -> "Lattice":
        """Find how large cells are.

        Parameters
        ----------
        frames
            ``(height, width, 3)`` uint8, a few dozen.

        Raises
        ------
        UsageError
            When the world is not drawn cell by cell.
        """
        height, width = frames[0].shape[:2]
        sides = [
            side
            for side in range(2, min(height, width) // _FEWEST_CELLS + 1)
            if height % side == 0 and width % side == 0
        ]
        if not sides:
            raise UsageError(f"a frame of {height} × {width} pixels cannot be cut into square cells")
        self.side_px_ = min(sides, key=lambda side: _bits(frames, side))
        cells = np.concatenate([_cells(frame, self.side_px_) for frame in frames])
        if len(np.unique(cells, axis=0)) > min(MAX_KINDS, len(cells) // 2):
            raise UsageError("what is seen is not drawn cell by cell, so there are no symbols to plan with")
        return self

    def read(self, frame: Image) -> Ints:
        """Return the kind of each cell, ``(rows, columns)``; appearances that are new become new kinds.

        Raises
        ------
        UsageError
            When there are too many kinds.
        """
        rows = frame.shape[0] // self.side_px_
        kinds = []
        for cell in _cells(frame, self.side_px_):
            key = cell.tobytes()
            if key not in self._kinds:
                self._kinds[key] = len(self.patterns_)
                self.patterns_.append(cell.reshape(self.side_px_, self.side_px_, 3))
            kinds.append(self._kinds[key])
        if len(self.patterns_) > MAX_KINDS:
            raise UsageError(f"there are more than {MAX_KINDS} appearances of cells: this is no discrete world")
        return np.array(kinds, np.int64).reshape(rows, -1)

    def to_arrays(self) -> Arrays:
        """Return how cells look."""
        return {"patterns": np.array(self.patterns_, np.uint8)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.patterns_ = list(arrays["patterns"])
        self.side_px_ = arrays["patterns"].shape[1]
        self._kinds = {pattern.tobytes(): kind for kind, pattern in enumerate(self.patterns_)}


def _cells(frame: Image, side: int) -> NDArray[np.uint8]:
    """Return the pixels of each cell, ``(cells, side · side · 3)``, row by row."""
    rows, columns = frame.shape[0] // side, frame.shape[1] // side
    parts = np.asarray(frame).reshape(rows, side, columns, side, 3).swapaxes(1, 2)
    return np.ascontiguousarray(parts.reshape(rows * columns, -1))


def _bits(frames: Sequence[Image], side: int) -> float:
    """Return in how many bits frames are said with cells of a side."""
    cells = np.concatenate([_cells(frame, side) for frame in frames])
    kinds = len({cell.tobytes() for cell in cells})
    return kinds * side * side * _PIXEL_BITS + len(cells) * math.log2(max(kinds, 2))
