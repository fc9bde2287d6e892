"""What the detector finds, drawn: the model `otsu` (§4.3)."""

from collections.abc import Sequence

import numpy as np

from semrl.core import Observation, Sight, State
from semrl.core.arrays import Arrays
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import label_image
from semrl.perception.encoders.grey import IMAGES
from semrl.perception.encoders.single_frames import SingleFrames
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import DetectorStage, Stage


class ComponentsEncoder:
    """Shows every connected component in a grey level of its own."""

    space = IMAGES

    def __init__(self, config: PerceptionConfig, *, rom: str | None = None, planning: bool = False) -> None:
        del planning
        self.rom = rom
        self.perception = Perception(config)

    @property
    def is_fitted(self) -> bool:
        """Whether the detector is."""
        return self.perception.detector.is_fitted

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return the detector's."""
        del config
        return [DetectorStage(self.perception)]

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(self._encode, self._look)

    def to_arrays(self) -> Arrays:
        """Return what was learned."""
        return self.perception.to_arrays()

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was learned."""
        self.perception.from_arrays(arrays)

    def _encode(self, observation: Observation) -> State:
        return State(vector=label_image(self.perception.detector.components(observation.frame)))

    def _look(self, observation: Observation) -> Sight:
        if not self.is_fitted:
            return Sight()
        objects = self.perception.detector.detect(observation.frame)
        return Sight(boxes_px=objects.boxes_px, labels=(objects.labels > 0).astype(np.int64))
