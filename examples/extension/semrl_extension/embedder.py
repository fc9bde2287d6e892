"""An embedder: how many objects of each class lie in each cell of a coarse grid."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from semrl.core import IMAGE_SIZE_PX, Floats, SceneGraph
from semrl.core.arrays import Arrays


@dataclass(frozen=True, kw_only=True)
class GridConfig:
    """How fine the grid is."""

    cells: int = 6
    """Cells along each side of the image."""
    classes: int = 10
    """Classes that are told apart; higher numbers share them."""


class GridEmbedder:
    """Learns nothing: it counts."""

    Config = GridConfig
    documents_needed = 0
    is_fitted = True

    def __init__(self, config: GridConfig) -> None:
        self.config = config
        self.dimension = config.classes * config.cells**2

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:
        """Learn nothing."""
        return self

    def transform(self, graph: SceneGraph) -> Floats:
        """Count the objects of a scene, ``(dimension,)`` float32."""
        counts = np.zeros((self.config.classes, self.config.cells, self.config.cells), np.float32)
        rows, columns = (graph.centres_px * self.config.cells / IMAGE_SIZE_PX).astype(int).T
        np.add.at(counts, (graph.classes % self.config.classes, rows, columns), 1)
        return counts.ravel()

    def to_arrays(self) -> Arrays:
        """Return nothing, which is what was learned."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""
