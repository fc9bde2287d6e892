"""A detector: whatever is brighter than a given grey level is an object."""

from dataclasses import dataclass
from typing import Self

from semrl.core import Frame, Ints, Objects
from semrl.core.arrays import Arrays
from semrl.perception.detection.components import connected_components
from semrl.perception.detection.cutting import cut_components
from semrl.perception.detection.grey import as_grey


@dataclass(frozen=True, kw_only=True)
class BrightConfig:
    """What is bright."""

    level: int = 100
    """Grey level, 0 … 255, above which a pixel is part of an object."""


class BrightDetector:
    """Learns nothing: the level is given."""

    Config = BrightConfig
    crop_size_px = 8
    frames_needed = 1
    is_fitted = True

    def __init__(self, config: BrightConfig) -> None:
        self.config = config

    def partial_fit(self, frame: Frame) -> Self:
        """Learn nothing."""
        return self

    def detect(self, frame: Frame) -> Objects:
        """Find what is bright, cut into pieces of at most 8 × 8 pixels."""
        image = as_grey(frame)
        return cut_components(image, connected_components(image, self.config.level), self.crop_size_px)

    def components(self, frame: Frame) -> Ints:
        """Number the bright regions."""
        return connected_components(as_grey(frame), self.config.level).labels

    def to_arrays(self) -> Arrays:
        """Return nothing, which is what was learned."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""
