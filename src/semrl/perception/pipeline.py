"""Elevation, the upper line of Fig. 1.1: from a raw frame to the state that an agent sees.

frame ─ grey image ─ objects ─ reduced objects ─ classes ─ scene graph ─ vector
                                                       └─ tracks ─ list of what moves: the model `objects`
                                                                         └─ scene graph ─ vector: tracked scenes
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Image, Ints, Objects, Observation, SceneGraph, Tracks
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.memo import Memo
from semrl.core.protocols import Persistent
from semrl.envs import ram_feature_names, ram_features
from semrl.perception.clustering import Birch
from semrl.perception.config import PipelineConfig, View, make_embedder
from semrl.perception.detection import ForegroundDetector, OtsuDetector, label_image
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import HashedEmbedding, Scenery, build_scene_graph
from semrl.perception.embedding.protocol import Embedder
from semrl.perception.reduction import ObjectPCA
from semrl.perception.tracking import AXES, SLOT_NUMBERS, Roles, follow, no_tracks


class Pipeline:
    """The boxes of the upper line, wired.

    Parameters
    ----------
    config
        Parameters of every box.
    view
        What `encode` returns.
    rom
        Name of the Atari game, needed for the view ``"ram"`` only.
    listed
        Whether the list of what moves stands behind the vector of a tracked scene, for those who reason about it.

    Raises
    ------
    UsageError
        When the view is ``"ram"`` and this game's RAM is not mapped.
    """

    def __init__(self, config: PipelineConfig, view: View, rom: str | None = None, *, listed: bool = False) -> None:
        self.config = config
        self.view = view
        self._listed = False
        self.rom = rom
        self.detector = OtsuDetector(config.detection)
        self.foreground = ForegroundDetector(config.foreground)
        self.pca = ObjectPCA(config.pca)
        self.birch = Birch(config.birch)
        self.scenery = Scenery()
        self._kinds = Memo(self._classify, self.crop_size_px**2, np.int32)  # the bits of a crop → its class
        self._kinds_learned: tuple[object, object] | None = None
        self.roles = Roles(config.roles)
        self.begin_episode()
        # Doc2vec needs an extra: do not ask for it where nothing is embedded.
        self.embedder: Embedder = make_embedder(config) if view == "embedding" else HashedEmbedding(config.hashed)
        self.shape: tuple[int, ...] = (IMAGE_SIZE_PX, IMAGE_SIZE_PX)
        if view == "ram":
            self.shape = (len(self.names),)
        elif view == "objects":
            self.shape = (self.roles.dimension,)
        elif view == "embedding":
            self._listed = listed and self.follows
            self.shape = (self.embedder.dimension + (self.roles.dimension if self._listed else 0),)
        self.dtype = np.dtype(np.uint8 if len(self.shape) == 2 else np.float32)

    @property
    def follows(self) -> bool:
        """Whether objects are followed through time."""
        return self.view == "objects" or (self.view == "embedding" and self.config.scene.tracked)

    @property
    def crop_size_px(self) -> int:
        """Side of the square crops that PCA and Birch are shown."""
        return self.foreground.crop_size_px if self.follows else self.detector.crop_size_px

    @property
    def facts(self) -> slice:
        """Which numbers of what `encode` returns are reasoned about: behind the vector of a tracked scene the list."""
        return slice(self.embedder.dimension if self._listed else 0, self.shape[0])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the facts, where they have names; of slots, only those that are in use."""
        if self.view == "ram":
            return ram_feature_names(self.rom or "")
        if self.view == "objects" or self._listed:
            return tuple(f"{role} {name}" for role in self.roles.names_ for name in SLOT_NUMBERS)
        return ()

    @property
    def axes(self) -> Ints | None:
        """Along which axis each fact lies, ``(k,)``, −1 for what is no place; None where that is not known."""
        if self.view == "objects" or self._listed:
            return np.tile([AXES.index(name) if name in AXES else -1 for name in SLOT_NUMBERS], self.config.roles.slots)
        return None

    def begin_episode(self) -> None:
        """Forget the tracks of the episode before."""
        self.tracks = no_tracks(self.config.pca.components)

    def encode(self, observation: Observation) -> NDArray[Any]:
        """Elevate one observation as far as the view goes.

        Where objects are tracked, observations are expected in their order, each once, and `begin_episode`
        before the first one of an episode.

        Returns
        -------
        ``shape`` of ``dtype``: an image ``(84, 84)`` uint8 or a vector ``(d,)`` float32.
        """
        if self.view == "ram":
            assert observation.ram is not None, "games with mapped RAM have RAM"
            return ram_features(self.rom or "", observation.ram)
        if self.follows:
            return self._tell(self.list_objects(observation))
        image = to_grey(observation.frame)
        if self.view == "grey":
            return image
        if self.view == "components":
            return label_image(self.detector.components(image))
        if self.view == "classes":
            return self.class_image(self.detector.detect(image))
        return self.embedder.transform(self.scene(image))

    def encode_batch(self, observations: Sequence[Observation]) -> NDArray[Any]:
        """Elevate one observation of each of several environments, to the same bits as one by one.

        Where objects are tracked, every environment needs a pipeline of its own; a shallow copy is enough.

        Returns
        -------
        ``(len(observations), *shape)`` of ``dtype``.
        """
        encoded = np.empty((len(observations), *self.shape), self.dtype)
        for row, observation in zip(encoded, observations, strict=True):
            row[...] = self.encode(observation)
        return encoded

    def detect(self, observation: Observation) -> Objects:
        """Find the objects of an observation, in the way of the view."""
        if self.follows:
            return self.foreground.detect(observation.frame)
        return self.detector.detect(to_grey(observation.frame))

    def classes(self, objects: Objects) -> Ints:
        """Return the class number of each object (§3.2.2); what was seen before is remembered until more is learned."""
        if not len(objects):
            return np.empty(0, np.int64)
        learned = self.pca.revision, self.birch.revision
        if learned != self._kinds_learned:
            self._kinds.clear()
            self._kinds_learned = learned
        known, places = self._kinds.look_up(objects.features.view(np.int32))
        classes: Ints = known[places]
        return classes

    def _classify(self, crops: NDArray[np.int32]) -> Ints:
        return self.birch.predict(self.pca.transform(crops.view(np.float32)))

    def follow(self, frame: Frame) -> Tracks:
        """Move the tracks on by one frame."""
        objects = self.foreground.detect(frame)
        reduced = self.pca.transform(objects.features)
        self.tracks = follow(self.tracks, objects, self.classes(objects), reduced, self.config.tracking)
        return self.tracks

    def settle_roles(self) -> Tracks:
        """Give the tracks their roles."""
        self.tracks = replace(self.tracks, roles=self.roles.predict(self.tracks))
        return self.tracks

    def list_objects(self, observation: Observation) -> Floats:
        """Move the tracks on by one observation and list what moves, ``(d,)`` float32; see `Roles.transform`."""
        self.follow(observation.frame)
        return self.roles.transform(self.settle_roles())

    def _tell(self, facts: Floats) -> Floats:
        if self.view == "objects":
            return facts
        return np.concatenate([self.embed(facts), facts]) if self._listed else self.embed(facts)

    def embed(self, facts: Floats) -> Floats:
        """Embed the scene that a list tells of, as it came or as it is foreseen."""
        return self.embedder.transform(self._listed_scene(facts))

    def class_image(self, objects: Objects) -> Image:
        """Draw every object in the grey level of its class."""
        return label_image(np.append(0, self.classes(objects) + 1)[objects.labels])

    def watch(self, observation: Observation) -> SceneGraph:
        """Write the next observation as a scene graph, in the way of the view."""
        if self.follows:
            return self._listed_scene(self.list_objects(observation))
        return self.scene(to_grey(observation.frame))

    def _listed_scene(self, facts: Floats) -> SceneGraph:
        return build_scene_graph(*self.roles.read(facts), self.config.scene.proximity_px)

    def scene(self, image: Image) -> SceneGraph:
        """Write a grey image as a scene graph (§3.2.3)."""
        objects = self.detector.detect(image)
        classes = self.classes(objects)
        shown = self.shown(classes)
        return build_scene_graph(classes[shown], objects.centres_px[shown], self.config.scene.proximity_px)

    def shown(self, classes: Ints) -> Ints:
        """Return which objects of a frame are part of the scene: all, or all but scenery."""
        if not self.config.scene.omit_scenery:
            return np.arange(len(classes))
        return np.flatnonzero(~self.scenery.is_still(classes))

    def to_arrays(self) -> Arrays:
        """Return what every box has learned, and the tracks of the episode."""
        return nest(**{name: box.to_arrays() for name, box in self._boxes().items()}, **self._tracked())

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what every box has learned."""
        for name, box in self._boxes().items():
            box.from_arrays(unnest(arrays, name))
        if self.follows:
            self.tracks = Tracks(**unnest(arrays, "tracks"))

    def _boxes(self) -> dict[str, Persistent]:
        """Return what learns, by name."""
        boxes: dict[str, Persistent] = {
            "detector": self.detector,
            "pca": self.pca,
            "birch": self.birch,
            "scenery": self.scenery,
            "embedder": self.embedder,
        }
        return boxes | ({"foreground": self.foreground, "roles": self.roles} if self.follows else {})

    def _tracked(self) -> dict[str, Arrays]:
        return {"tracks": asdict(self.tracks)} if self.follows else {}
