"""The preprocessed frame alone: the model `baseline` (§4.3)."""

from collections.abc import Sequence

import numpy as np

from semrl.core import IMAGE_SIZE_PX, Observation, Sight, State, StateSpace
from semrl.core.arrays import Arrays
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection.grey import to_grey
from semrl.perception.encoders.single_frames import SingleFrames
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import Stage

IMAGES = StateSpace(shape=(IMAGE_SIZE_PX, IMAGE_SIZE_PX), dtype=np.uint8)
"""The space of encoders that show images."""


class GreyEncoder:
    """Shows the small grey image; nothing is learned."""

    perception = None
    space = IMAGES
    is_fitted = True

    def __init__(self, config: PerceptionConfig, *, rom: str | None = None, planning: bool = False) -> None:
        del config, planning
        self.rom = rom

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return none."""
        del config
        return []

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(_encode, lambda _: Sight())

    def to_arrays(self) -> Arrays:
        """Return nothing."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""


def _encode(observation: Observation) -> State:
    return State(vector=to_grey(observation.frame))
