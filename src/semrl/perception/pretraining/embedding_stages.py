"""The stage in which the embedder learns from scenes (§3.2.3), where there is anything to learn."""

from abc import abstractmethod
from typing import Protocol

import numpy as np

from semrl.core import Observation, SceneGraph
from semrl.core.arrays import Arrays, arrays_to_ragged, nest, ragged_to_arrays, unnest
from semrl.core.protocols import Persistent
from semrl.perception.embedding import build_scene_graph
from semrl.perception.embedding.protocol import OnlineEmbedder
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stages import Stage


class SceneSource(Persistent, Protocol):
    """Writes the observations of an episode, one after the other, as scene graphs."""

    def begin(self) -> None:
        """Begin an episode."""
        ...

    def scene(self, observation: Observation) -> SceneGraph:
        """Write the next observation."""
        ...


class _EmbedderStage(Stage):
    """Show the embedder scenes."""

    name = "embedding"
    unit = "documents"
    PARTS = ("source",)

    def __init__(self, perception: Perception, source: SceneSource) -> None:
        super().__init__()
        self.perception = perception
        self.source = source
        self.target = perception.embedder.documents_needed

    def _learn(self, observation: Observation, action: int | None) -> bool:
        if action is None:
            self.source.begin()
        return self._study(self.source.scene(observation))

    @abstractmethod
    def _study(self, scene: SceneGraph) -> bool: ...


class DocumentsStage(_EmbedderStage):
    """Gather scenes, then train the embedder on all of them at once."""

    def __init__(self, perception: Perception, source: SceneSource) -> None:
        super().__init__(perception, source)
        self.scenes_: list[SceneGraph] = []

    def _study(self, scene: SceneGraph) -> bool:
        self.scenes_.append(scene)
        if len(self.scenes_) < self.target:
            return False
        self.perception.embedder.fit(self.scenes_)
        return True

    def to_arrays(self) -> Arrays:
        """Return the gathered scenes as well; their edges follow from the centres."""
        classes = ragged_to_arrays([s.classes for s in self.scenes_], like=np.empty(0, np.int64))
        centres = ragged_to_arrays([s.centres_px for s in self.scenes_], like=np.empty((0, 2), np.float32))
        return {**super().to_arrays(), **nest(classes=classes, centres=centres)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the stage was."""
        super().from_arrays(arrays)
        classes, centres = (arrays_to_ragged(unnest(arrays, name)) for name in ("classes", "centres"))
        proximity = self.perception.config.scene.proximity_px
        self.scenes_ = [build_scene_graph(c, p, proximity) for c, p in zip(classes, centres, strict=True)]


class OnlineStage(_EmbedderStage):
    """Let an embedder learn from scenes as they come; none of them is kept."""

    def _study(self, scene: SceneGraph) -> bool:
        assert isinstance(self.perception.embedder, OnlineEmbedder)
        self.perception.embedder.partial_fit(scene)
        return self.batches_ >= self.target


def embedder_stages(perception: Perception, source: SceneSource) -> list[Stage]:
    """Return the stage in which the embedder learns; none where there is nothing to learn."""
    if not perception.embedder.documents_needed:
        return []
    online = isinstance(perception.embedder, OnlineEmbedder)
    return [OnlineStage(perception, source) if online else DocumentsStage(perception, source)]
