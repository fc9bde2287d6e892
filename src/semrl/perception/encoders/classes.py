"""Every object drawn in the grey level of its class: the model `birch` (§4.3)."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from semrl.core import Image, Objects, Observation, Sight, State
from semrl.perception.detection import label_image
from semrl.perception.encoders.grey import IMAGES
from semrl.perception.encoders.single_frames import SingleFrames
from semrl.perception.encoders.through import ThroughPerception
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import ClustererStage, DetectorStage, ReducerStage, Stage


class ClassesEncoder(ThroughPerception):
    """Shows the classes of the objects of each frame."""

    space = IMAGES

    @property
    def is_fitted(self) -> bool:
        """Whether classes are known."""
        return self.perception.clusterer.is_fitted

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return those of detector, reducer and clusterer."""
        seen = self.perception
        return [DetectorStage(seen), ReducerStage(seen, config), ClustererStage(seen, config)]

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(self._encode, partial(look_at_classes, self.perception))

    def _encode(self, observation: Observation) -> State:
        return State(vector=class_image(self.perception, self.perception.objects(observation)))


def class_image(perception: Perception, objects: Objects) -> Image:
    """Draw every object in the grey level of its class."""
    return label_image(np.append(0, perception.classes(objects) + 1)[objects.labels])


def look_at_classes(perception: Perception, observation: Observation) -> Sight:
    """Show the objects of a frame and, where they are known, their classes."""
    if not perception.detector.is_fitted:
        return Sight()
    objects = perception.objects(observation)
    known = perception.clusterer.is_fitted
    classes = perception.classes(objects) if known else np.empty(0, np.int64)
    numbers = classes if known else np.zeros(len(objects), np.int64)
    return Sight(boxes_px=objects.boxes_px, classes=classes, labels=np.append(0, numbers + 1)[objects.labels])
