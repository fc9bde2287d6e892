"""The control: a scene as a plain list of its objects, without any thought of what a vector should be like."""

from dataclasses import dataclass

import numpy as np

from semrl.core import IMAGE_SIZE_PX, Floats, SceneGraph
from semrl.core.errors import UsageError
from semrl.perception.embedding.scene_graph import object_keys
from semrl.perception.embedding.unlearned import Unlearned

SLOT = 4
"""Numbers that describe one object: 1 for being there, class, row and column."""

CLASSES = 16
"""Class numbers are divided by it, so that they lie near 0 … 1 as rows and columns do."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SlotsEmbeddingConfig:
    """Settings of `SlotsEmbedding`."""

    dimension: int = 128
    """Length of the vectors; four numbers describe one object."""

    def __post_init__(self) -> None:
        if self.dimension < SLOT or self.dimension % SLOT:
            raise UsageError(f"dimension must be a multiple of {SLOT} from {SLOT} on, not {self.dimension}")


class SlotsEmbedding(Unlearned):
    """Embeds a scene as its objects one after the other, by class, then row, then column.

    Each fills a slot: 1, class / 16, row / 84, column / 84. Empty slots are zeros; objects beyond the last slot are
    left out. An object that appears shifts all after it.
    """

    def __init__(self, config: SlotsEmbeddingConfig | None = None) -> None:
        self.config = config or SlotsEmbeddingConfig()
        super().__init__(self.config.dimension)

    def transform(self, graph: SceneGraph) -> Floats:
        """List the objects of a scene, ``(dimension,)`` float32; zeros for a scene without objects.

        Raises
        ------
        DataError
            If a centre is not finite or too far away.
        """
        keys = object_keys(graph)
        order = np.lexsort(keys.T[::-1])[: self.dimension // SLOT]
        slots = np.zeros((self.dimension // SLOT, SLOT), np.float32)
        slots[: len(order), 0] = 1
        slots[: len(order), 1:] = keys[order] / (CLASSES, 2 * IMAGE_SIZE_PX, 2 * IMAGE_SIZE_PX)
        return slots.ravel()
