"""What the detector finds, drawn: the model `otsu` (§4.3)."""

from collections.abc import Sequence

import numpy as np

from semrl.core import Observation, Sight, State
from semrl.perception.detection import label_image
from semrl.perception.encoders.grey import IMAGES
from semrl.perception.encoders.single_frames import SingleFrames
from semrl.perception.encoders.through import ThroughPerception
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import DetectorStage, Stage


class ComponentsEncoder(ThroughPerception):
    """Shows every connected component in a grey level of its own."""

    space = IMAGES

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

    def _encode(self, observation: Observation) -> State:
        return State(vector=label_image(self.perception.components(observation)))

    def _look(self, observation: Observation) -> Sight:
        if not self.is_fitted:
            return Sight()
        objects = self.perception.objects(observation)
        return Sight(boxes_px=objects.boxes_px, labels=(objects.labels > 0).astype(np.int64))
