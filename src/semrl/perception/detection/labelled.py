"""Objects from labels that the environment offers, as ViZDoom does: what perception would see if it made no mistake."""

import hashlib
from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Ints, Labels, Objects, Observation
from semrl.core.errors import UsageError
from semrl.core.protocols import Stateless
from semrl.perception.detection.foreground_kernels import draw_objects


@dataclass(frozen=True, kw_only=True)
class LabelsConfig:
    """Which labelled objects are seen."""

    omit: tuple[str, ...] = ()
    """Classes that are left out, such as DoomPlayer, the player's own weapon."""


class LabelsDetector(Stateless):
    """Each object that the environment labels is an object, of the class that it is labelled with; nothing is learned.

    Places, boxes and colours are those of its pixels. Its crop is not drawn: each class has a pattern of 64 bits, the
    same in every run, so that the reducer and clusterer, which see crops, find the environment's classes again.

    Examples
    --------
    >>> values = np.zeros((168, 168), np.uint8)
    >>> values[20:28, 40:44], values[60:64, 80:90] = 7, 9
    >>> labels = Labels(values=values, classes={7: "Medikit", 9: "Medikit"})
    >>> frame = np.zeros((168, 168, 3), np.uint8)
    >>> LabelsDetector().read(Observation(frame=frame, labels=labels)).boxes_px.tolist()
    [[10, 20, 4, 2], [30, 40, 2, 5]]
    """

    crop_size_px = 8
    """Edge of a class's pattern."""
    frames_needed = 1
    """One, in which there is something."""
    is_fitted = True
    """There is nothing to learn."""

    def __init__(self, config: LabelsConfig | None = None) -> None:
        self.config = config or LabelsConfig()

    def partial_fit(self, frame: Frame) -> Self:  # noqa: ARG002
        """Learn nothing."""
        return self

    def read(self, observation: Observation) -> Objects:
        """Return the labelled objects of a frame, by their values."""
        labels = observation.labels
        if labels is None:
            raise _unlabelled("the environment offers none")
        pixels = np.ascontiguousarray(observation.frame)
        if labels.values.shape != pixels.shape[:2]:
            raise UsageError(f"labels are of {labels.values.shape} pixels, frames of {pixels.shape[:2]}")
        values, classes = self._seen(labels)
        places, ends = _pixels_of(labels.values, values)
        starts = np.append(0, ends[:-1])[: len(ends)]
        _, centres, boxes, drawn, edges, colours = draw_objects(
            pixels, places, starts, ends, self.crop_size_px, IMAGE_SIZE_PX
        )
        crops = np.stack([_pattern(name) for name in classes]) if classes else np.zeros((0, 8, 8), np.float32)
        return Objects(crops=crops, centres_px=centres, boxes_px=boxes, labels=drawn, edges_px=edges, colours=colours)

    def detect(self, frame: Frame) -> Objects:
        """Fail: a frame alone has no labels.

        Raises
        ------
        UsageError
            Always.
        """
        raise _unlabelled(f"a frame {frame.shape} alone has none")

    def components(self, frame: Frame) -> NDArray[np.int32]:
        """Fail, as `detect`."""
        return self.detect(frame).labels

    def _seen(self, labels: Labels) -> tuple[list[int], list[str]]:
        """Return the values of the objects of a frame, ascending, and their classes."""
        classes = labels.classes
        there = np.flatnonzero(np.bincount(labels.values.ravel(), minlength=1)).tolist()
        named = [(value, str(value) if classes is None else classes.get(value, "")) for value in there if value]
        seen = [(value, name) for value, name in named if name and name not in self.config.omit]
        return [value for value, _ in seen], [name for _, name in seen]


def _pixels_of(image: NDArray[np.uint8], values: list[int]) -> tuple[NDArray[np.int32], Ints]:
    """Return the pixels of each value, row × width + column, behind each other, and where those of each end."""
    pixels = [np.flatnonzero(image == value).astype(np.int32) for value in values]
    return np.concatenate([np.empty(0, np.int32), *pixels]), np.cumsum([len(p) for p in pixels], dtype=np.int64)


@cache
def _pattern(name: str) -> Floats:
    """Return the pattern of a class, ``(8, 8)`` float32 of 0 and 1: two of them differ in half of their bits."""
    digest = hashlib.blake2b(name.encode(), digest_size=8).digest()
    return np.unpackbits(np.frombuffer(digest, np.uint8)).reshape(8, 8).astype(np.float32)


def _unlabelled(why: str) -> UsageError:
    return UsageError(
        f"the detector 'labels' needs labels, and {why}: set --environment.labels in ViZDoom's games, or show a "
        "dictionary with 'labels' beside the image"
    )
