"""The preprocessed frame alone: the model `baseline` (§4.3)."""

import numpy as np

from semrl.core import IMAGE_SIZE_PX, Observation, State, StateSpace
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection.grey import to_grey
from semrl.perception.encoders.single_frames import AsItIs, SingleFrames, see_nothing

IMAGES = StateSpace(shape=(IMAGE_SIZE_PX, IMAGE_SIZE_PX), dtype=np.uint8)
"""The space of encoders that show images."""


class GreyEncoder(AsItIs):
    """Shows the small grey image; nothing is learned."""

    space = IMAGES

    def __init__(self, config: PerceptionConfig, *, rom: str | None = None, planning: bool = False) -> None:
        del config, planning
        self.rom = rom

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(_encode, see_nothing)


def _encode(observation: Observation) -> State:
    return State(vector=to_grey(observation.frame))
