"""Object detection by what differs from the background, at full resolution and by colour.

The detector of §3.2.1 joins objects that touch in the small grey image, loses what is as dark as the background,
and knows positions to half a pixel. This one keeps the frame as it is.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Frame, Image, Ints, Objects
from semrl.core.errors import DataError, UsageError
from semrl.core.protocols import Saved
from semrl.perception.detection.flashes import Flashes
from semrl.perception.detection.foreground_kernels import Places, draw_objects, find_components, vote, without_holes
from semrl.perception.detection.ground import Ground
from semrl.perception.detection.panels import Panels
from semrl.perception.detection.parts import Parts
from semrl.perception.detection.restless import Restless

_PIECES = 4
"""An object may be found in so many pieces, on average."""

_SURE = 2
"""Times the frames of learning: no later votes outweigh so many."""


@dataclass(frozen=True, kw_only=True)
class ForegroundConfig:
    """What differs from the background."""

    background_frames: int = 500
    """Frames whose commonest colour at each place is taken for the background."""
    contrast: int = 12
    """Pixels whose colours differ by more than this in some channel, of 255, are different."""
    max_objects: int = 64
    """Most objects of a frame; the smallest are left out."""
    parts_share: float = 0.9
    """Share of one colour's pieces that must touch one of another, for what touches of the two to be one object."""

    def __post_init__(self) -> None:
        if self.background_frames < 1 or self.max_objects < 1:
            raise UsageError("foreground.background_frames and foreground.max_objects must be 1 or more")
        if not self.parts_share > 0:
            raise UsageError(f"foreground.parts_share must be above 0, not {self.parts_share}")
        if not 0 <= self.contrast < 255:
            raise UsageError(f"foreground.contrast must lie in 0 … 254, not {self.contrast}")


class ForegroundDetector(Saved):
    """Objects are connected pixels of one colour, or pieces that go together, that differ from the background.

    The background is the colour that a pixel has most of the time, found by majority vote (Boyer & Moore,
    "MJRTY: a fast majority vote algorithm", 1991), so what stands still is no object, and neither is what
    changes in the same places all the time (see `Restless`), what a display shows (see `Panels`), ground that flashes
    (see `Flashes`), and ground where something of the background is gone. What leaves its place and comes back is one,
    however long it is there (see `without_leaving`). Positions are means over an object's pixels in the full frame,
    given in pixels of the 84×84 image. Crops are drawn around an object's own middle, so that they do not change with
    its place; a pixel counts a fifth for being there and up to four for its grey level, so that black objects are seen
    too. Objects larger than the window are drawn smaller, not cut.

    Attributes
    ----------
    frames_ : int
        Frames that the background was learned from.
    """

    SAVED, PARTS = ("frames_", "_background", "_votes"), ("_parts", "_restless", "_panels")

    crop_size_px = 8
    """Edge of the window of one object, in pixels of the 84×84 image."""

    def __init__(self, config: ForegroundConfig | None = None) -> None:
        self.config = config or ForegroundConfig()
        self.frames_ = 0
        self._background: Frame = np.zeros((0, 0, 0), np.uint8)
        self._votes: NDArray[np.int32] = np.zeros((0, 0), np.int32)
        self._parts = Parts(self.config.parts_share)
        self._restless = Restless()
        self._flashes: Flashes | None = None
        self._panels = Panels()

    @property
    def is_fitted(self) -> bool:
        """Whether enough frames were seen to know the background."""
        return self.frames_ >= self.config.background_frames

    @property
    def frames_needed(self) -> int:
        """How many frames `partial_fit` wants."""
        return self.config.background_frames

    @property
    def background_(self) -> Frame:
        """The commonest colours, ``(height, width, channels)`` uint8."""
        return self._background.copy()

    def partial_fit(self, frame: Frame | Image) -> Self:
        """Look at one more frame, ``(height, width, 3)`` or grey ``(height, width)`` uint8, until there are enough."""
        pixels = self._checked(frame)
        if not self.is_fitted:
            if not self.frames_:
                self._background, self._votes = np.zeros_like(pixels), np.zeros(pixels.shape[:2], np.int32)
            vote(pixels, self._background, self._votes)
            self.frames_ += 1
            if 2 * self.frames_ <= self.config.background_frames:
                self._flashes = None
                self._restless.learn(self._flash.calmed(pixels))
            else:  # by now the background is known well enough
                if self._restless.is_learning:
                    self._look_back()
                pixels = self._flash.calmed(pixels)
                self._panels.check(pixels, self._background)
                pieces = find_components(pixels, self._background, self.config.contrast)
                self._restless.check(*pieces, pixels.shape[1])
                self._parts.learn(pixels, *self._components(pixels))
            if self.is_fitted:
                self._parts.settle(self._background)
                self._flashes = None
        return self

    def _look_back(self) -> None:
        """Find what is background beside the commonest colours, and what is none, in the frames seen so far."""
        changed = self._restless.changed.reshape(self._votes.shape)
        self._panels.propose(changed, self._background)
        behind = self._restless.without_leaving(self._background)
        left = (behind != self._background).any(axis=2)
        self._background, self._votes = behind, np.where(left, _SURE * self.config.background_frames, self._votes)
        self._restless.settle(self._background)
        self._restless.forget()
        self._flashes = None

    def ground(self) -> Ground:
        """Return what stands still, found in the background; see `KnowsGround`."""
        return Ground(self.background_, self.config.contrast)

    def detect(self, frame: Frame | Image) -> Objects:
        """Find the objects of a frame, from top to bottom."""
        if not self.frames_:
            raise DataError("the detector has seen no frame yet: call partial_fit first")
        pixels = self._flash.calmed(self._checked(frame))
        places, ends = self._parts.joined(pixels, *self._components(pixels))
        sizes = np.diff(ends, prepend=0)
        kept = np.sort(np.argsort(-sizes, kind="stable")[: self.config.max_objects])
        drawn = draw_objects(pixels, places, (ends - sizes)[kept], ends[kept], self.crop_size_px, IMAGE_SIZE_PX)
        crops, centres, boxes, labels, edges, colours = drawn
        return Objects(crops=crops, centres_px=centres, boxes_px=boxes, labels=labels, edges_px=edges, colours=colours)

    def components(self, frame: Frame | Image) -> NDArray[np.int32]:
        """Number the objects of a frame, ``(84, 84)``; 0 is background. They are not cut, so these are components."""
        return self.detect(frame).labels

    def _restored(self) -> None:
        self._flashes = None

    @property
    def _flash(self) -> Flashes:
        """The commonest colour of the background, and what undoes it if it flashes."""
        if self._flashes is None:
            self._flashes = Flashes(self._background)
        return self._flashes

    def _components(self, pixels: Frame) -> tuple[Places, Ints]:
        """Return pieces of one colour; of very many only the largest, since all are compared with each other."""
        calm = self._panels.calmed(self._restless.calmed(pixels, self._background), self._background)
        places, ends = find_components(calm, self._background, self.config.contrast)
        places, ends = without_holes(calm, self._background, self._flash.ground, places, ends, self.config.contrast)
        most = _PIECES * self.config.max_objects
        if len(ends) <= most:
            return places, ends
        sizes = np.diff(ends, prepend=0)
        kept = np.zeros(len(ends), np.bool_)
        kept[np.argsort(-sizes, kind="stable")[:most]] = True
        return places[np.repeat(kept, sizes)], np.cumsum(sizes[kept])

    def _checked(self, frame: Frame | Image) -> Frame:
        """Return the frame with its channels as last axis."""
        pixels = frame[:, :, None] if frame.ndim == 2 else frame
        if pixels.ndim != 3 or pixels.dtype != np.uint8 or pixels.size == 0:
            raise DataError(f"expected a frame (height, width, channels) of uint8, got {frame.shape} of {frame.dtype}")
        if self.frames_ and pixels.shape != self._background.shape:
            raise DataError(f"the background is of frames {self._background.shape}; this one is {pixels.shape}")
        return np.ascontiguousarray(pixels)
