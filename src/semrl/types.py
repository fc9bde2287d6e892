"""The nouns that flow through the pipeline: small frozen dataclasses over arrays.

Positions are in pixels of the preprocessed 84×84 image, ``(row, column)``, measured from the top left
corner; a pixel's centre lies at its integer coordinate.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
"""An RGB image, ``(height, width, 3)``."""

IMAGE_SIZE_PX = 84
"""Edge of the preprocessed image (§3.2.1)."""

Image = NDArray[np.uint8]
"""A preprocessed grey or labelled image, ``(84, 84)``."""

Floats = NDArray[np.float32]
Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Observation:
    """What the environment shows at one decision: the frame and, for Atari games, the RAM."""

    frame: Frame
    ram: NDArray[np.uint8] | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """What one decision led to."""

    observation: Observation
    reward: float
    terminated: bool
    truncated: bool

    @property
    def done(self) -> bool:
        """Whether the episode is over, for whichever reason."""
        return self.terminated or self.truncated


@dataclass(frozen=True, kw_only=True, slots=True)
class Objects:
    """The objects of one frame (§3.2.1), component by component, the pieces of one from left to right.

    Attributes
    ----------
    crops
        ``(n, 8, 8)`` float32 in 0 … 1: each object centred in a window of its own, background 0.
    centres_px
        ``(n, 2)`` float32, row and column of the centre of the bounding box.
    boxes_px
        ``(n, 4)`` int64: top, left, height, width.
    labels
        ``(84, 84)`` int32: 0 for the background, ``i + 1`` for the pixels of object ``i``.
    """

    crops: Floats
    centres_px: Floats
    boxes_px: Ints
    labels: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.crops)

    @property
    def features(self) -> Floats:
        """The crops as rows, ``(n, 64)``."""
        return self.crops.reshape(len(self.crops), math.prod(self.crops.shape[1:]))


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneGraph:
    """One frame as a graph (§3.2.3): objects are nodes, close objects are joined.

    Attributes
    ----------
    classes
        ``(n,)`` int64, the class number of each object.
    centres_px
        ``(n, 2)`` float32, row and column.
    edges
        ``(m, 2)`` int64, each pair of joined nodes once, smaller index first.
    lengths_px
        ``(m,)`` float32, the Euclidean distance of the two centres.
    """

    classes: Ints
    centres_px: Floats
    edges: Ints
    lengths_px: Floats

    def __len__(self) -> int:
        return len(self.classes)


Vector = NDArray[np.floating[Any]]
