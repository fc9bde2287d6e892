"""Perception: the learned boxes of the upper line of Fig. 1.1, shared by all who look through them.

frame ─ objects ─ reduced objects ─ classes ─ scene graph ─ vector
                                       └─ tracks ─ list of what moves ─ scene graph ─ vector
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, Objects, Observation, SceneGraph, Tracks
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.memo import Memo
from semrl.core.protocols import Persistent
from semrl.perception.config import CLUSTERERS, EMBEDDERS, REDUCERS, PerceptionConfig, make_detector
from semrl.perception.detection import Ground
from semrl.perception.detection.protocol import KnowsGround, ReadsLabels
from semrl.perception.embedding import Scenery, build_scene_graph
from semrl.perception.embedding.protocol import Embedder
from semrl.perception.tracking import Jumps, SlotAssigner, follow, no_tracks


class Perception:
    """What perception has learned, and what it makes of a frame.

    Nothing here belongs to an episode: tracks go in and come out. So one perception serves any number of environments.

    Parameters
    ----------
    config
        Which boxes, and the parameters of each.
    tracked
        Whether objects are followed from decision to decision.
    embedded
        Whether scenes become vectors; without it no embedder is made.

    Attributes
    ----------
    detector, reducer, clusterer, scenery, jumps, slot_assigner
        The boxes; scenery is of single frames, jumps and the slot assigner of tracked objects.
    """

    def __init__(self, config: PerceptionConfig, *, tracked: bool = False, embedded: bool = False) -> None:
        self.config = config
        self.tracked = tracked
        self.detector = make_detector(config, tracked=tracked)
        self.reducer = REDUCERS.make(config.reducer, config)
        self.clusterer = CLUSTERERS.make(config.clusterer, config)
        self.scenery = Scenery()
        self.jumps = Jumps(config.tracking.gate_px)
        self.slot_assigner = SlotAssigner(config.slot_assigner)
        self._embedder = EMBEDDERS.make(config.embedder, config) if embedded else None
        self._read = self.detector.read if isinstance(self.detector, ReadsLabels) else None
        self._ground: Ground | None = None
        self._known = Memo(self._classify, self.detector.crop_size_px**2, np.int32)  # the bits of a crop → its class
        self._learned: tuple[object, object] | None = None

    @property
    def ground(self) -> Ground | None:
        """What stands still, found in the background; None where the detector knows no background (yet)."""
        detector = self.detector
        if self._ground is None and isinstance(detector, KnowsGround) and self.detector.is_fitted:
            self._ground = detector.ground()
        return self._ground

    @property
    def embedder(self) -> Embedder:
        """What writes scenes as vectors."""
        assert self._embedder is not None, "asked for by encoders of scenes only"
        return self._embedder

    def objects(self, observation: Observation) -> Objects:
        """Find the objects of what is shown (§3.2.1)."""
        return self._read(observation) if self._read else self.detector.detect(observation.frame)

    def components(self, observation: Observation) -> NDArray[np.integer[Any]]:
        """Number the regions that objects are cut from, ``(84, 84)``; 0 is background."""
        return self._read(observation).labels if self._read else self.detector.components(observation.frame)

    def classes(self, objects: Objects) -> Ints:
        """Return the class number of each object (§3.2.2); what was seen before is remembered until more is learned."""
        if not len(objects):
            return np.empty(0, np.int64)
        learned = self.reducer.revision, self.clusterer.revision
        if learned != self._learned:
            self._known.clear()
            self._learned = learned
        known, places = self._known.look_up(objects.features.view(np.int32))
        classes: Ints = known[places]
        return classes

    def begin(self) -> Tracks:
        """Return the tracks at the beginning of an episode: none."""
        return no_tracks(self.reducer.dimension)

    def track(self, tracks: Tracks, observation: Observation) -> Tracks:
        """Move the tracks of an episode on by one decision."""
        objects = self.objects(observation)
        reduced = self.reducer.transform(objects.features)
        classes = self.classes(objects)
        return follow(tracks, objects, classes, reduced, self.config.tracking, reach_px=self.jumps.reach_px_)

    def assign(self, tracks: Tracks) -> Tracks:
        """Give the tracks their roles."""
        return replace(tracks, roles=self.slot_assigner.predict(tracks))

    def scene(self, observation: Observation) -> SceneGraph:
        """Write a single frame as a scene graph (§3.2.3)."""
        objects = self.objects(observation)
        classes = self.classes(objects)
        shown = self.shown(classes)
        return build_scene_graph(classes[shown], objects.centres_px[shown], self.config.scene.proximity_px)

    def shown(self, classes: Ints) -> Ints:
        """Return which objects of a frame are part of the scene: all, or all but scenery."""
        if not self.config.scene.omit_scenery:
            return np.arange(len(classes))
        return np.flatnonzero(~self.scenery.is_still(classes))

    def listed_scene(self, facts: Floats) -> SceneGraph:
        """Write a list of tracked objects as a scene graph."""
        return build_scene_graph(*self.slot_assigner.read(facts), self.config.scene.proximity_px)

    def to_arrays(self) -> Arrays:
        """Return what every box has learned."""
        return nest(**{name: box.to_arrays() for name, box in self._boxes().items()})

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what every box has learned."""
        for name, box in self._boxes().items():
            box.from_arrays(unnest(arrays, name))
        self._ground = None

    def _boxes(self) -> dict[str, Persistent]:
        boxes: dict[str, Persistent] = {
            "detector": self.detector,
            "reducer": self.reducer,
            "clusterer": self.clusterer,
        }
        tracking = {"jumps": self.jumps, "slot_assigner": self.slot_assigner}
        boxes |= tracking if self.tracked else {"scenery": self.scenery}
        return boxes | ({"embedder": self._embedder} if self._embedder else {})

    def _classify(self, crops: Ints) -> Ints:
        return self.clusterer.predict(self.reducer.transform(crops.view(np.float32)))
