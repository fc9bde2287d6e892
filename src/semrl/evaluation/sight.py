"""What a run's perception makes of one frame: for videos and reports."""

import contextlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Ints, Observation
from semrl.core.errors import DataError
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import build_scene_graph
from semrl.perception.pipeline import Pipeline

CLASS_COLOURS: tuple[tuple[int, int, int], ...] = (
    (59, 142, 234), (242, 169, 59), (53, 183, 121), (232, 87, 90), (167, 123, 220),
    (63, 193, 201), (241, 120, 182), (201, 201, 74), (181, 131, 90), (154, 165, 177),
    (46, 92, 190), (186, 104, 20), (140, 222, 160), (172, 38, 72), (214, 184, 255), (96, 140, 36),
)  # fmt: skip
"""RGB of class 0, 1, …: as many as the presets have kinds; later classes begin again."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Sight:
    """What perception makes of one frame; everything it has not learned stays empty.

    Attributes
    ----------
    boxes_px
        ``(n, 4)`` int64, top, left, height and width in the 84×84 image.
    classes
        ``(n,)`` int64, or ``(0,)`` where objects have no classes.
    edges
        ``(m, 2)`` int64, pairs of objects that the scene graph joins.
    labels
        ``(84, 84)`` int64: 0 for the background, class + 1 for objects.
    names
        What is written beside each box; empty where there is nothing to write.
    seen
        What the agent is shown: an image, a vector, or None while that is not learned.
    """

    boxes_px: Ints
    classes: Ints
    edges: Ints
    labels: Ints
    seen: NDArray[Any] | None
    names: tuple[str, ...] = ()


def look(pipeline: Pipeline, observation: Observation) -> Sight:
    """Look at one frame as a run's perception does; where objects are tracked, at one after the other."""
    with contextlib.suppress(DataError):
        return look_again(pipeline, observation, pipeline.encode(observation))
    return look_again(pipeline, observation, None)


def look_again(pipeline: Pipeline, observation: Observation, seen: NDArray[Any] | None) -> Sight:
    """Look at the frame that was encoded last, as ``seen``, or not at all."""
    if pipeline.follows and seen is not None:
        return _look_at_slots(pipeline, seen)
    classes, edges = np.empty(0, np.int64), np.empty((0, 2), np.int64)
    if pipeline.follows or pipeline.view in ("grey", "ram") or not pipeline.detector.is_fitted:
        blank = np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX), np.int64)
        return Sight(boxes_px=np.empty((0, 4), np.int64), classes=classes, edges=edges, labels=blank, seen=seen)
    objects = pipeline.detector.detect(to_grey(observation.frame))
    if pipeline.birch.n_leaves_:
        classes = pipeline.classes(objects)
    if pipeline.view == "embedding" and len(classes):
        shown = pipeline.shown(classes)
        scene = build_scene_graph(classes[shown], objects.centres_px[shown], pipeline.config.scene.proximity_px)
        edges = shown[scene.edges]
    numbers = classes if len(classes) else np.zeros(len(objects), np.int64)
    labels = np.append(0, numbers + 1)[objects.labels]
    return Sight(boxes_px=objects.boxes_px, classes=classes, edges=edges, labels=labels, seen=seen)


def _look_at_slots(pipeline: Pipeline, seen: NDArray[Any]) -> Sight:
    """Show the tracks that are told of, each with the name of its role and its identity."""
    tracks, slots = pipeline.tracks, pipeline.roles.slots_.tolist()
    told = np.flatnonzero(tracks.visible & np.isin(tracks.roles, slots))
    labels = np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX), np.int64)
    for (top, left, height, width), number in zip(tracks.boxes_px[told].tolist(), tracks.classes[told], strict=True):
        labels[top : top + height, left : left + width] = number + 1
    return Sight(
        boxes_px=tracks.boxes_px[told],
        classes=tracks.classes[told],
        edges=np.empty((0, 2), np.int64),
        labels=labels,
        seen=seen[pipeline.facts][: len(pipeline.names)] if pipeline.names else seen,
        names=tuple(f"{pipeline.roles.names_[slots.index(tracks.roles[i])]}: {tracks.ids[i]}" for i in told),
    )
