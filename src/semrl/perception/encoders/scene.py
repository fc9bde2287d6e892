"""The scene graph of a single frame as a vector: the models `semantic` and `semantic-map` (§3.2.3)."""

from collections.abc import Sequence
from dataclasses import replace

from semrl.core import Observation, SceneGraph, Sight, State, StateSpace
from semrl.core.protocols import Stateless
from semrl.perception.embedding import build_scene_graph
from semrl.perception.encoders.classes import look_at_classes
from semrl.perception.encoders.single_frames import SingleFrames
from semrl.perception.encoders.through import ThroughPerception
from semrl.perception.perception import Perception
from semrl.perception.pretraining.embedding_stages import embedder_stages
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import (
    ClustererStage,
    DetectorStage,
    ReducerStage,
    SceneryStage,
    Stage,
)


class SceneEncoder(ThroughPerception):
    """Shows the embedded scene graph; planners reason about the same numbers."""

    embedded = True

    @property
    def space(self) -> StateSpace:
        """What its states have in common."""
        dimension = self.perception.embedder.dimension
        return StateSpace(shape=(dimension,), n_facts=dimension)

    @property
    def is_fitted(self) -> bool:
        """Whether classes are known and scenes can be embedded."""
        return self.perception.clusterer.is_fitted and self.perception.embedder.is_fitted

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return those of detector, reducer and clusterer, of scenery where it is left out, and of the embedder."""
        seen = self.perception
        return [
            DetectorStage(seen),
            ReducerStage(seen, config),
            ClustererStage(seen, config),
            *([SceneryStage(seen)] if seen.config.scene.omit_scenery else []),
            *embedder_stages(seen, _Scenes(seen)),
        ]

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(self._encode, self._look)

    def _encode(self, observation: Observation) -> State:
        vector = self.perception.embedder.transform(self.perception.scene(observation))
        return State(vector=vector, facts=vector)

    def _look(self, observation: Observation) -> Sight:
        seen = look_at_classes(self.perception, observation)
        if not len(seen.classes):
            return seen
        objects = self.perception.objects(observation)
        shown = self.perception.shown(seen.classes)
        proximity = self.perception.config.scene.proximity_px
        scene = build_scene_graph(seen.classes[shown], objects.centres_px[shown], proximity)
        return replace(seen, edges=shown[scene.edges])


class _Scenes(Stateless):
    """The scenes of single frames."""

    def __init__(self, perception: Perception) -> None:
        self._perception = perception

    def begin(self) -> None:
        """Do nothing: frames do not know of each other."""

    def scene(self, observation: Observation) -> SceneGraph:
        """Write one frame."""
        return self._perception.scene(observation)
