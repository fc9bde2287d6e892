"""The stages of what perception learns before the agent (§3.2.3); `schedule` puts them in order."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from semrl.core import Observation, SceneGraph
from semrl.core.arrays import Arrays, arrays_to_ragged, nest, ragged_to_arrays, unnest
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import OnlineEmbedding, build_scene_graph
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.stability import (
    StabilityConfig,
    StabilityTest,
    label_agreement,
    mean_absolute_difference,
)


class Stage(ABC):
    """One thing to learn before the next.

    Attributes
    ----------
    name : str
        As metrics and progress bars show it.
    unit : str
        What `batches_` counts.
    goal : int
        How many batches it takes; 0 when that is not known beforehand.
    batches_ : int
        How many it took so far.
    """

    name: str
    unit = "frames"
    goal = 0

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        self.batches_ = 0

    def learn(self, observation: Observation, action: int | None) -> bool:
        """Learn from one observation and the action that led there; return whether the stage is complete."""
        self.batches_ += 1
        return self._learn(observation, action)

    @abstractmethod
    def _learn(self, observation: Observation, action: int | None) -> bool: ...

    def measured(self) -> dict[str, Any]:
        """Return what there is to tell after the last batch: columns of the metrics."""
        return {}

    def to_arrays(self) -> Arrays:
        """Return the state of the stage, without what the pipeline has learned in it."""
        return {"batches": np.array(self.batches_)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the stage was."""
        self.batches_ = int(arrays["batches"])


class PlayStage(Stage):
    """See so much play, which the stages after this one study."""

    name = "play"
    unit = "decisions"

    def __init__(self, pipeline: Pipeline, decisions: int) -> None:
        super().__init__(pipeline)
        self.goal = decisions

    def _learn(self, _observation: Observation, _action: int | None) -> bool:
        return self.batches_ >= self.goal


class ThresholdStage(Stage):
    """Find Otsu's threshold, once."""

    name = "threshold"

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline)
        self.goal = pipeline.config.detection.threshold_frames

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        return self.pipeline.detector.partial_fit(to_grey(observation.frame)).is_fitted


class BackgroundStage(Stage):
    """Find what a frame looks like without anything that moves."""

    name = "background"

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline)
        self.goal = pipeline.config.foreground.background_frames

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        return self.pipeline.foreground.partial_fit(observation.frame).is_fitted


class _StableStage(Stage):
    """Train one estimator on the objects of each frame until its output is stable."""

    unit = "batches"

    def __init__(self, pipeline: Pipeline, test: StabilityTest, max_batches: int) -> None:
        super().__init__(pipeline)
        self.test = test
        self.max_batches = max_batches

    def measured(self) -> dict[str, Any]:
        """Return the value of the stability test at the last batch, once there is one."""
        return {"stability": self.test.values_[-1]} if self.test.values_ else {}

    def to_arrays(self) -> Arrays:
        """Return the state of the test as well."""
        return {**super().to_arrays(), **nest(test=self.test.to_arrays())}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the stage was."""
        super().from_arrays(arrays)
        self.test.from_arrays(unnest(arrays, "test"))


class PCAStage(_StableStage):
    """Train PCA on the unique objects of each frame."""

    name = "pca"

    def __init__(self, pipeline: Pipeline, config: StabilityConfig) -> None:
        test = StabilityTest(
            output=pipeline.pca.transform,
            measure=mean_absolute_difference,
            is_stable=lambda difference: difference < config.max_difference,
            batches=config.batches,
        )
        super().__init__(pipeline, test, config.max_batches)

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        objects = self.pipeline.detect(observation)
        pca = self.pipeline.pca
        if len(objects):
            pca.partial_fit(objects.features)
        stable = bool(len(objects)) and pca.is_fitted and self.test.update(objects.features)
        return stable or (pca.is_fitted and self.batches_ >= self.max_batches)


class BirchStage(_StableStage):
    """Train Birch on all objects of each frame."""

    name = "birch"

    def __init__(self, pipeline: Pipeline, config: StabilityConfig) -> None:
        test = StabilityTest(
            output=pipeline.birch.predict,
            measure=label_agreement,
            is_stable=lambda agreement: agreement > config.min_agreement,
            batches=config.batches,
        )
        super().__init__(pipeline, test, config.max_batches)

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        objects = self.pipeline.detect(observation)
        stable = False
        if len(objects):
            reduced = self.pipeline.pca.transform(objects.features)
            self.pipeline.birch.partial_fit(reduced)
            stable = self.test.update(reduced)
        return stable or (self.pipeline.birch.n_leaves_ > 0 and self.batches_ >= self.max_batches)

    def measured(self) -> dict[str, Any]:
        """Return the number of leaves as well."""
        return {**super().measured(), "leaves": self.pipeline.birch.n_leaves_}


class SceneryStage(Stage):
    """See which kinds of objects move."""

    name = "scenery"

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline)
        self.goal = pipeline.config.scene.scenery_frames

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        objects = self.pipeline.detect(observation)
        self.pipeline.scenery.partial_fit(self.pipeline.classes(objects), objects.centres_px)
        return self.batches_ >= self.goal


class RolesStage(Stage):
    """Follow objects and see which of them move, and by what."""

    name = "roles"

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline)
        self.goal = pipeline.config.roles.frames

    def _learn(self, observation: Observation, action: int | None) -> bool:
        tracks = self.pipeline.follow(observation.frame)
        self.pipeline.roles.partial_fit(tracks, action)
        self.pipeline.settle_roles()
        return self.pipeline.roles.is_fitted


class DocumentsStage(Stage):
    """Gather scenes, then train the embedding on all of them at once."""

    name = "documents"
    unit = "documents"

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline)
        self.goal = pipeline.embedder.documents_needed
        self.scenes_: list[SceneGraph] = []

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        self.scenes_.append(self.pipeline.watch(observation))
        if len(self.scenes_) < self.goal:
            return False
        self.pipeline.embedder.fit(self.scenes_)
        return True

    def to_arrays(self) -> Arrays:
        """Return the gathered scenes; their edges follow from the centres."""
        classes = ragged_to_arrays([s.classes for s in self.scenes_], like=np.empty(0, np.int64))
        centres = ragged_to_arrays([s.centres_px for s in self.scenes_], like=np.empty((0, 2), np.float32))
        return {**super().to_arrays(), **nest(classes=classes, centres=centres)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the stage was."""
        super().from_arrays(arrays)
        classes, centres = (arrays_to_ragged(unnest(arrays, name)) for name in ("classes", "centres"))
        proximity = self.pipeline.config.scene.proximity_px
        self.scenes_ = [build_scene_graph(c, p, proximity) for c, p in zip(classes, centres, strict=True)]


class OnlineStage(Stage):
    """Let an embedding learn from scenes as they come; none of them is kept."""

    name = "documents"
    unit = "documents"

    def __init__(self, pipeline: Pipeline, embedder: OnlineEmbedding) -> None:
        super().__init__(pipeline)
        self.embedder = embedder
        self.goal = embedder.documents_needed

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        self.embedder.partial_fit(self.pipeline.watch(observation))
        return self.batches_ >= self.goal
