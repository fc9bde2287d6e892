"""The scene graph of tracked objects as a vector: `semantic` and `semantic-map` in the preset `semrl`."""

from collections.abc import Sequence

import numpy as np

from semrl.core import Floats, Observation, SceneGraph, State, StateSpace
from semrl.core.arrays import Arrays
from semrl.perception.encoders.objects import TrackedEpisode, listed_space, tracking_stages
from semrl.perception.encoders.through import ThroughPerception
from semrl.perception.perception import Perception
from semrl.perception.pretraining.embedding_stages import embedder_stages
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import Stage


class TrackedSceneEncoder(ThroughPerception):
    """Shows the embedded scene of tracked objects.

    Planners reason about the list of them, which is then shown as well: the vector of a predicted scene follows from
    the predicted list, while its own numbers are too many for trees.
    """

    tracked = embedded = True

    @property
    def space(self) -> StateSpace:
        """What its states have in common; names are known when roles are."""
        dimension = self.perception.embedder.dimension
        return listed_space(self.perception, before=dimension) if self.planning else StateSpace(shape=(dimension,))

    @property
    def is_fitted(self) -> bool:
        """Whether roles are known and scenes can be embedded."""
        return self.perception.slot_assigner.is_fitted and self.perception.embedder.is_fitted

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return those of detector, reducer, clusterer, roles and embedder."""
        scenes = _TrackedScenes(self.perception)
        return [*tracking_stages(self.perception, config), *embedder_stages(self.perception, scenes)]

    def begin(self) -> TrackedEpisode:
        """Begin an episode."""
        return TrackedEpisode(self.perception, self._write)

    def embed(self, facts: Floats) -> Floats:
        """Embed the scene of a list, as it came or as it is predicted."""
        return self.perception.embedder.transform(self.perception.listed_scene(facts))

    def _write(self, facts: Floats, things: Floats) -> State:
        if not self.planning:
            return State(vector=self.embed(facts))
        return State(vector=np.concatenate([self.embed(facts), facts]), facts=facts, things=things)


class _TrackedScenes:
    """The scenes of an episode of tracked objects."""

    def __init__(self, perception: Perception) -> None:
        self._perception = perception
        self.begin()

    def begin(self) -> None:
        """Forget the tracks of the episode before."""
        self._episode = TrackedEpisode(self._perception)

    def scene(self, observation: Observation) -> SceneGraph:
        """Write the next observation."""
        return self._perception.listed_scene(self._episode.facts(observation))

    def to_arrays(self) -> Arrays:
        """Return the tracks."""
        return self._episode.to_arrays()

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on with the tracks that were saved."""
        self._episode.from_arrays(arrays)
