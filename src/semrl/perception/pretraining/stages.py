"""The stages in which perception learns before the agent does (§3.2.3); each encoder says which it needs."""

from abc import ABC, abstractmethod
from dataclasses import asdict
from typing import Any

from semrl.core import Objects, Observation
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.core.protocols import Saved
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stability import (
    StabilityConfig,
    StabilityTest,
    label_agreement,
    mean_absolute_difference,
)
from semrl.perception.tracking import restored_tracks

LEAST_FRAMES = 100
"""Frames that are looked at before it is said that there is nothing in them."""

MOST_EMPTY_FRAMES = 2_000
"""Frames in a row without any object, after which no more are waited for."""

OTHERWISE = "or a model that sees frames as they are: --model baseline"


class Stage(Saved, ABC):
    """One thing to learn before the next.

    Attributes
    ----------
    name : str
        As metrics and progress bars show it.
    unit : str
        What `batches_` counts.
    target : int
        How many batches it takes; 0 when that is not known beforehand.
    batches_ : int
        How many it took so far.
    """

    name: str
    unit = "frames"
    target = 0
    SAVED: tuple[str, ...] = ("batches_",)

    def __init__(self) -> None:
        self.batches_ = 0

    def learn(self, observation: Observation, action: int | None) -> bool:
        """Learn from one observation and the action that led there; return whether the stage is complete.

        Observations come in their order; at the beginning of an episode there is no action.

        Raises
        ------
        UsageError
            When it has found nothing that the next stage could go on with.
        """
        self.batches_ += 1
        return self._learn(observation, action)

    def require_found(self) -> None:
        """Check, before the stage is complete, that it has found something by now.

        Raises
        ------
        UsageError
            When it had enough to find it in.
        """

    @abstractmethod
    def _learn(self, observation: Observation, action: int | None) -> bool: ...

    def measured(self) -> dict[str, Any]:
        """Return what there is to report after the last batch: columns of the metrics."""
        return {}


class PlayStage(Stage):
    """See so much play, from which the stages after this one learn."""

    name = "play"
    unit = "decisions"

    def __init__(self, decisions: int) -> None:
        super().__init__()
        self.target = decisions

    def _learn(self, _observation: Observation, _action: int | None) -> bool:
        return self.batches_ >= self.target


class DetectorStage(Stage):
    """Learn what is no object: Otsu's threshold, or the background."""

    name = "detection"

    def __init__(self, perception: Perception) -> None:
        super().__init__()
        self.perception = perception
        self.target = perception.detector.frames_needed

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        if not self.perception.detector.partial_fit(observation.frame).is_fitted:
            return False
        if len(self.perception.objects(observation)):
            return True
        if self.batches_ >= self.target + max(self.target, LEAST_FRAMES):
            self.require_found()
        return False

    def require_found(self) -> None:
        """Check that there was an object since it was learned what is none; see `Stage.require_found`."""
        if self.perception.detector.is_fitted:
            raise _nothing(self, "no object", f"another --perception.detector, {OTHERWISE}")


class _StableStage(Stage):
    """Train one estimator on the objects of each frame until its output is stable."""

    unit = "batches"
    SAVED, PARTS = ("batches_", "empty_"), ("test",)

    def __init__(self, perception: Perception, test: StabilityTest, max_batches: int) -> None:
        super().__init__()
        self.perception = perception
        self.test = test
        self.max_batches = max_batches
        self.empty_ = 0  # frames without an object, up to the newest one

    def require_found(self) -> None:
        """Check that there were objects; see `Stage.require_found`."""
        if self.empty_ == self.batches_ > 0 or self.empty_ >= MOST_EMPTY_FRAMES:
            raise _nothing(self, "no object", f"another --perception.detector, {OTHERWISE}")

    def _detected(self, observation: Observation) -> Objects:
        """Return the objects of a frame; frames without any are no batches, and are not waited through for ever."""
        objects = self.perception.objects(observation)
        self.empty_ = 0 if len(objects) else self.empty_ + 1
        if self.empty_ >= MOST_EMPTY_FRAMES:
            self.require_found()
        return objects

    def measured(self) -> dict[str, Any]:
        """Return the value of the stability test at the last batch, once there is one."""
        return {"stability": self.test.values_[-1]} if self.test.values_ else {}


class ReducerStage(_StableStage):
    """Train the reducer on the unique objects of each frame."""

    name = "reduction"

    def __init__(self, perception: Perception, config: StabilityConfig) -> None:
        test = StabilityTest(
            output=perception.reducer.transform,
            measure=mean_absolute_difference,
            is_stable=lambda difference: difference < config.max_difference,
            batches=config.batches,
        )
        super().__init__(perception, test, config.max_batches)

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        objects = self._detected(observation)
        reducer = self.perception.reducer
        if len(objects):
            reducer.partial_fit(objects.features)
        stable = bool(len(objects)) and reducer.is_fitted and self.test.update(objects.features)
        return stable or (reducer.is_fitted and self.batches_ >= self.max_batches)


class ClustererStage(_StableStage):
    """Train the clusterer on all objects of each frame; where these are to be followed, see how far they jump."""

    name = "clustering"

    def __init__(self, perception: Perception, config: StabilityConfig) -> None:
        test = StabilityTest(
            output=perception.clusterer.predict,
            measure=label_agreement,
            is_stable=lambda agreement: agreement > config.min_agreement,
            batches=config.batches,
        )
        super().__init__(perception, test, config.max_batches)

    def _learn(self, observation: Observation, action: int | None) -> bool:
        objects = self._detected(observation)
        if self.perception.tracked:
            self.perception.jumps.partial_fit(objects.centres_px, begins=action is None)
        stable = False
        if len(objects):
            reduced = self.perception.reducer.transform(objects.features)
            self.perception.clusterer.partial_fit(reduced)
            stable = self.test.update(reduced)
        done = stable or (self.perception.clusterer.is_fitted and self.batches_ >= self.max_batches)
        if done and not self.perception.clusterer.n_clusters_:
            raise _nothing(self, "no class of objects", f"another --perception.clusterer, {OTHERWISE}")
        return done

    def measured(self) -> dict[str, Any]:
        """Return the number of clusters as well."""
        return {**super().measured(), "clusters": self.perception.clusterer.n_clusters_}


class SceneryStage(Stage):
    """See which kinds of objects move."""

    name = "scenery"

    def __init__(self, perception: Perception) -> None:
        super().__init__()
        self.perception = perception
        self.target = perception.config.scene.scenery_frames

    def _learn(self, observation: Observation, _action: int | None) -> bool:
        objects = self.perception.objects(observation)
        scenery = self.perception.scenery.partial_fit(self.perception.classes(objects), objects.centres_px)
        done = self.batches_ >= self.target
        if done and not len(scenery.moving_):
            more = "more of them (--perception.scene.scenery-frames), --perception.scene.no-omit-scenery"
            raise _nothing(self, "no kind of object that moves", f"{more}, {OTHERWISE}")
        return done


class SlotsStage(Stage):
    """Follow objects and see which of them move, and by what."""

    name = "roles"

    def __init__(self, perception: Perception) -> None:
        super().__init__()
        self.perception = perception
        self.target = perception.config.slot_assigner.frames
        self._tracks = perception.begin()

    def _learn(self, observation: Observation, action: int | None) -> bool:
        before = self.perception.begin() if action is None else self._tracks
        tracks = self.perception.track(before, observation)
        assigner = self.perception.slot_assigner.partial_fit(tracks, action)
        self._tracks = self.perception.assign(tracks)
        if assigner.is_fitted and not len(assigner.slots_):
            more = "more of them (--perception.slot-assigner.frames), another --environment.frame-skip"
            raise _nothing(self, "nothing that moves", f"{more}, {OTHERWISE}")
        return assigner.is_fitted

    def to_arrays(self) -> Arrays:
        """Return the tracks of the episode as well."""
        return {**super().to_arrays(), **nest(tracks=asdict(self._tracks))}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the stage was."""
        super().from_arrays(arrays)
        self._tracks = restored_tracks(unnest(arrays, "tracks"))


def _nothing(stage: Stage, what: str, advice: str) -> UsageError:
    """Return what is to be raised where a stage found nothing: all that follows would see nothing either."""
    return UsageError(f"the stage '{stage.name}' of perception found {what} in {stage.batches_:,} frames; try {advice}")
