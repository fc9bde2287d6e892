"""Object detection by a threshold and connected components (§3.2.1)."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Frame, Image, Objects
from semrl.core.arrays import Arrays
from semrl.core.errors import DataError, UsageError
from semrl.perception.detection.components import connected_components
from semrl.perception.detection.cutting import cut_components
from semrl.perception.detection.grey import as_grey


@dataclass(frozen=True, kw_only=True)
class DetectionConfig:
    """What counts as an object."""

    threshold_share: float = 0.9
    """Share of Otsu's threshold that is used: lowering it finds rather more objects than fewer."""
    threshold_frames: int = 50
    """Frames whose Otsu thresholds are looked at once, at the beginning; their median is kept."""
    max_object_share: float = 0.1
    """Objects longer than this share of the image are cut."""

    def __post_init__(self) -> None:
        if not 0 < self.threshold_share <= 1:
            raise UsageError(f"threshold_share must be above 0 and at most 1, not {self.threshold_share}")
        if self.threshold_frames < 1:
            raise UsageError(f"threshold_frames must be 1 or more, not {self.threshold_frames}")
        if not 1 / IMAGE_SIZE_PX <= self.max_object_share <= 1:
            raise UsageError(f"max_object_share must be at least one pixel and at most 1, not {self.max_object_share}")


class OtsuDetector:
    """Foreground is what is brighter than a fixed threshold; its connected components are objects.

    The threshold of Otsu (1979) is found once (§3.2.1), from the median over the first frames: the
    very first frames of a game often show a blank or half-drawn screen.

    Attributes
    ----------
    thresholds_ : list of float
        Otsu's threshold of each frame looked at, in grey levels.
    """

    def __init__(self, config: DetectionConfig | None = None) -> None:
        self.config = config or DetectionConfig()
        self.thresholds_: list[float] = []
        self._median = 0.0

    @property
    def is_fitted(self) -> bool:
        """Whether enough frames were seen to fix the threshold."""
        return len(self.thresholds_) >= self.config.threshold_frames

    @property
    def frames_needed(self) -> int:
        """How many frames `partial_fit` wants."""
        return self.config.threshold_frames

    @property
    def threshold_(self) -> float:
        """The lowered threshold in grey levels; pixels above it are foreground."""
        if not self.thresholds_:
            raise DataError("the detector has seen no image yet: call partial_fit first")
        return self._median * self.config.threshold_share

    @property
    def crop_size_px(self) -> int:
        """Edge of the window of one object: the largest size that is not cut."""
        return int(IMAGE_SIZE_PX * self.config.max_object_share)

    def partial_fit(self, frame: Frame | Image) -> Self:
        """Look at one more frame, RGB or the grey image ``(84, 84)`` made of it, until there are enough."""
        image = as_grey(frame)
        if not self.is_fitted:
            threshold, _ = cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)
            self._keep([*self.thresholds_, float(threshold)])
        return self

    def components(self, frame: Frame | Image) -> NDArray[np.int32]:
        """Number the connected components (8 neighbours) of the foreground, ``(84, 84)``; 0 is background."""
        return connected_components(as_grey(frame), self.threshold_).labels

    def detect(self, frame: Frame | Image) -> Objects:
        """Find the objects of a frame: its components, the large ones cut into equal parts."""
        image = as_grey(frame)
        return cut_components(image, connected_components(image, self.threshold_), self.crop_size_px)

    def to_arrays(self) -> Arrays:
        """Return the thresholds found."""
        return {"thresholds": np.array(self.thresholds_)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over thresholds."""
        self._keep(arrays["thresholds"].tolist())

    def _keep(self, thresholds: list[float]) -> None:
        self.thresholds_ = thresholds
        self._median = float(np.median(thresholds)) if thresholds else 0.0
