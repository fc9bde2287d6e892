"""What perception learns before the agent, one stage after the other (§3.2.3).

    threshold → PCA until stable → Birch until stable → scenery → documents of the embedding
    background → PCA until stable → Birch until stable → roles → documents, where objects are tracked

Actions are random meanwhile: the agent cannot see yet, and chance explores. Either each stage plays on, or all study
the same play: see `StabilityConfig.decisions`.
"""

from collections.abc import Sequence

import numpy as np

from semrl.core import Observation
from semrl.core.arrays import Arrays, nest, unnest
from semrl.perception.config import View
from semrl.perception.embedding import OnlineEmbedding
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import (
    BackgroundStage,
    BirchStage,
    DocumentsStage,
    OnlineStage,
    PCAStage,
    PlayStage,
    RolesStage,
    SceneryStage,
    Stage,
    ThresholdStage,
)


class Schooling:
    """All stages that a pipeline's view needs, in order.

    Parameters
    ----------
    pipeline
        Learns in place.
    config
        When PCA and Birch are stable, and of how much play.

    Attributes
    ----------
    remembers : bool
        Whether all is learned from the same play.
    max_batches : int
        Batches after which a stage ends that can go on without being stable.
    """

    def __init__(self, pipeline: Pipeline, config: StabilityConfig) -> None:
        stages = _stages(pipeline, pipeline.view, config)
        self.remembers = bool(config.decisions and stages)
        self.max_batches = config.max_batches
        self.stages: Sequence[Stage] = [PlayStage(pipeline, config.decisions), *stages] if self.remembers else stages
        self._position = 0

    @property
    def current(self) -> Stage | None:
        """The stage that is being learned; None when perception is ready."""
        return self.stages[self._position] if self._position < len(self.stages) else None

    @property
    def studies(self) -> bool:
        """Whether what comes next is to be learned from the play that there was."""
        return self.remembers and 0 < self._position < len(self.stages)

    def learn(self, observation: Observation, action: int | None = None) -> Stage:
        """Learn from one observation and the action that led there, if any; return the stage that did."""
        stage = self.stages[self._position]
        if stage.learn(observation, action):
            self._position += 1
        return stage

    def to_arrays(self) -> Arrays:
        """Return which stage it is, and its state."""
        state = nest(stage=self.current.to_arrays()) if self.current else {}
        return {"position": np.array(self._position), **state}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the schooling was."""
        self._position = int(arrays["position"])
        if self.current:
            self.current.from_arrays(unnest(arrays, "stage"))


def _stages(pipeline: Pipeline, view: View, config: StabilityConfig) -> list[Stage]:
    if view in ("grey", "ram"):
        return []
    stages: list[Stage] = [BackgroundStage(pipeline) if pipeline.follows else ThresholdStage(pipeline)]
    if view in ("classes", "embedding", "objects"):
        stages += [PCAStage(pipeline, config), BirchStage(pipeline, config)]
    if pipeline.follows:
        stages.append(RolesStage(pipeline))
    elif view == "embedding" and pipeline.config.scene.omit_scenery:
        stages.append(SceneryStage(pipeline))
    if view == "embedding" and pipeline.embedder.documents_needed:
        embedder = pipeline.embedder
        if isinstance(embedder, OnlineEmbedding):
            stages.append(OnlineStage(pipeline, embedder))
        else:
            stages.append(DocumentsStage(pipeline))
    return stages
