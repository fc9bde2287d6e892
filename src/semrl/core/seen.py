"""What the upper line makes of a frame: observations, objects, tracks, scenes."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semrl.core.named import IMAGE_SIZE_PX, Floats, Frame, Ints


@dataclass(frozen=True, kw_only=True, slots=True)
class Labels:
    """What an environment itself says is where in a frame."""

    values: NDArray[np.uint8]
    """``(height, width)`` uint8, as large as the frame: the value of the object that a pixel belongs to; 0: of none."""
    classes: dict[int, str] | None = None
    """Value → class of the object; what has no class here is background. None: each value but 0 is a class."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Observation:
    """What the environment shows at one decision: the frame and, where it offers them, RAM (Atari games) and labels."""

    frame: Frame
    ram: NDArray[np.uint8] | None = None
    labels: Labels | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """What one decision led to."""

    observation: Observation
    reward: float
    training_reward: float
    """What is learned from in place of the reward: a loss where a life was lost, else the reward."""
    terminated: bool
    truncated: bool

    @property
    def done(self) -> bool:
        """Whether the episode is over, for whichever reason."""
        return self.terminated or self.truncated


@dataclass(frozen=True, kw_only=True, slots=True)
class Objects:
    """The objects of one frame (§3.2.1), component by component, the pieces of one from left to right."""

    crops: Floats
    """``(n, 8, 8)`` float32 in 0 … 1: each object centred in a window of its own, background 0."""
    centres_px: Floats
    """``(n, 2)`` float32, row and column of the centre of the bounding box (where they are found at full resolution:
    the mean of the pixels)."""
    boxes_px: Ints
    """``(n, 4)`` int64: top, left, height, width."""
    labels: NDArray[np.int32]
    """``(84, 84)`` int32: 0 for the background, ``i + 1`` for the pixels of object ``i``."""
    edges_px: Floats | None = None
    """``(n, 4)`` float32: left, top, right and bottom as exactly as the detector knows them, in pixels of the 84×84
    image, the last two exclusive; None where it knows no more than the boxes."""
    colours: Floats | None = None
    """``(n, 3)`` float32: mean red, green and blue in 0 … 255; None where the detector knows no colours."""

    def __len__(self) -> int:
        return len(self.crops)

    @property
    def features(self) -> Floats:
        """The crops as rows, ``(n, 64)``."""
        return self.crops.reshape(len(self.crops), math.prod(self.crops.shape[1:]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Tracks:
    """Objects through time, as of one decision: those that are seen and those that were seen shortly before."""

    ids: Ints
    """``(n,)`` int64, ascending: the identity of each, never given twice in an episode."""
    classes: Ints
    """``(n,)`` int64, class number when last seen."""
    features: Floats
    """``(n, k)`` float32, reduced appearance when last seen."""
    centres_px: Floats
    """``(n, 2)`` float32, row and column; of what is not seen, where it would be if it went on."""
    boxes_px: Ints
    """``(n, 4)`` int64: top, left, height, width when last seen."""
    edges_px: Floats
    """``(n, 4)`` float32: left, top, right and bottom when last seen, as exactly as the detector knows them."""
    velocities_px: Floats
    """``(n, 2)`` float32, rows and columns a decision."""
    ages: Ints
    """``(n,)`` int64, decisions since it was first seen."""
    time_since_update: Ints
    """``(n,)`` int64, decisions since it was last seen; 0 for what is seen."""
    moves: Ints
    """``(n,)`` int64, decisions at which it was seen in another place than before."""
    colours: Floats
    """``(n, 3)`` float32, mean red, green and blue in 0 … 255 when last seen; zeros where there are none."""
    roles: Ints
    """``(n,)`` int64, the role that each has (`semrl.perception.tracking.SlotAssigner`); −1 for none."""
    born: Ints
    """``()`` int64, how many there were so far in the episode: the next identity."""

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Whether each is seen, ``(n,)``."""
        seen: NDArray[np.bool_] = self.time_since_update == 0
        return seen


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneGraph:
    """One frame as a graph (§3.2.3): objects are nodes, close objects are joined."""

    classes: Ints
    """``(n,)`` int64, the class number of each object."""
    centres_px: Floats
    """``(n, 2)`` float32, row and column."""
    edges: Ints
    """``(m, 2)`` int64, each pair of joined nodes once, smaller index first."""
    lengths_px: Floats
    """``(m,)`` float32, the Euclidean distance of the two centres."""

    def __len__(self) -> int:
        return len(self.classes)


@dataclass(frozen=True, kw_only=True, slots=True)
class Sight:
    """What perception makes of one frame, to be drawn; everything it has not learned stays empty."""

    boxes_px: Ints = field(default_factory=lambda: np.empty((0, 4), np.int64))
    """``(n, 4)`` int64, top, left, height and width in the 84×84 image."""
    classes: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    """``(n,)`` int64, or ``(0,)`` where objects have no classes."""
    edges: Ints = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """``(m, 2)`` int64, pairs of objects that the scene graph joins."""
    labels: Ints = field(default_factory=lambda: np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX), np.int64))
    """``(84, 84)`` int64: 0 for the background, class + 1 for objects."""
    names: tuple[str, ...] = ()
    """What is written beside each box; empty where there is nothing to write."""
    remarks: tuple[str, ...] = ()
    """What is to be said of them: what is taken for what, and since when."""
