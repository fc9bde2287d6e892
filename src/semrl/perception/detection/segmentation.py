"""Object detection by segmenting the image with k-means (§2.3, §2.3.3)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Frame, Image, Ints, Objects
from semrl.core.errors import DataError, UsageError
from semrl.core.protocols import Saved
from semrl.perception.detection.components import Components, connected_components
from semrl.perception.detection.cutting import cut_components
from semrl.perception.detection.grey import as_grey
from semrl.perception.lloyd import k_means, nearest, total

_PIXELS = IMAGE_SIZE_PX**2


@dataclass(frozen=True, kw_only=True)
class KMeansDetectorConfig:
    """How an image is segmented."""

    clusters: int = 3
    """Clusters of pixels, of which one is the background."""
    learning_frames: int = 50
    """Frames whose pixels are clustered, at the beginning."""
    position_weight: float = 0.0
    """What a way across the whole image counts as, in grey levels; 0: pixels are told apart by grey level alone."""
    max_object_share: float = 0.1
    """Objects longer than this share of the image are cut."""
    seed: int = 0
    """Of the first centres."""

    def __post_init__(self) -> None:
        if self.clusters < 2:
            raise UsageError(f"clusters must be 2 or more, not {self.clusters}")
        if self.learning_frames < 1:
            raise UsageError(f"learning_frames must be 1 or more, not {self.learning_frames}")
        if not 0 <= self.position_weight < np.inf:
            raise UsageError(f"position_weight must be 0 or more, not {self.position_weight}")
        if not 1 / IMAGE_SIZE_PX <= self.max_object_share <= 1:
            raise UsageError(f"max_object_share must be at least one pixel and at most 1, not {self.max_object_share}")
        if self.seed < 0:
            raise UsageError(f"seed must be 0 or more, not {self.seed}")


class KMeansDetector(Saved):
    """Pixels are clustered by k-means (§2.3, §2.3.3); what is joined and of one cluster is an object.

    The pixels of the first frames are clustered together, by grey level and, if wanted, position. The cluster
    of most pixels is the background. In each of the others, connected components are objects, and large ones are cut as
    those of `OtsuDetector` are. Unlike there, what is darker than the background is found too, and things of
    different brightness that touch stay apart.

    Attributes
    ----------
    frames_ : int
        Frames that were learned from.
    centres_ : ndarray
        ``(k, 1)`` or ``(k, 3)`` float64, darkest first: grey level and, weighted, row and column; fewer than
        ``clusters`` where there are fewer different pixels.
    background_ : int
        Which of them is the background.

    Examples
    --------
    >>> image = np.full((84, 84), 90, np.uint8)
    >>> image[10:14, 20:22], image[30:32, 40:45] = 30, 200
    >>> KMeansDetector().partial_fit(image).detect(image).boxes_px.tolist()
    [[10, 20, 4, 2], [30, 40, 2, 5]]
    """

    SAVED = ("frames_", "centres_", "background_", "_pixels", "_counts")

    def __init__(self, config: KMeansDetectorConfig | None = None) -> None:
        self.config = config or KMeansDetectorConfig()
        self.frames_ = 0
        self.centres_ = np.zeros((0, 0))
        self.background_ = 0
        self._pixels = np.zeros(0, np.int64)  # different ones, as `_numbered` numbers them
        self._counts = np.zeros(0)  # how often each was seen

    @property
    def is_fitted(self) -> bool:
        """Whether enough frames were seen."""
        return self.frames_ >= self.config.learning_frames

    @property
    def frames_needed(self) -> int:
        """How many frames `partial_fit` wants."""
        return self.config.learning_frames

    @property
    def crop_size_px(self) -> int:
        """Edge of the window of one object: the largest size that is not cut."""
        return int(IMAGE_SIZE_PX * self.config.max_object_share)

    def partial_fit(self, frame: Frame | Image) -> Self:
        """Look at one more frame, RGB or the grey image ``(84, 84)`` made of it, until there are enough."""
        image = as_grey(frame)
        if self.is_fitted:
            return self
        seen = np.concatenate([self._pixels, self._numbered(image)])
        counts = np.concatenate([self._counts, np.ones(_PIXELS)])
        self._pixels, places = np.unique(seen, return_inverse=True)
        self._counts = total(places, counts, len(self._pixels))
        self.frames_ += 1
        # Clustering costs the more, the more frames there are: before the last one, only when their number has doubled.
        if self.is_fitted or self.frames_ & (self.frames_ - 1) == 0:
            self._cluster()
        if self.is_fitted:
            self._pixels, self._counts = np.zeros(0, np.int64), np.zeros(0)
        return self

    def segment(self, frame: Frame | Image) -> Ints:
        """Return the cluster of each pixel, ``(84, 84)`` int64: places in `centres_`.

        Raises
        ------
        DataError
            No image was learned from yet, or as `partial_fit`.
        """
        if not self.frames_:
            raise DataError("the detector has seen no image yet: call partial_fit first")
        image = as_grey(frame)
        clusters: Ints = nearest(self._features(self._numbered(image)), self.centres_).reshape(image.shape)
        return clusters

    def components(self, frame: Frame | Image) -> NDArray[np.int32]:
        """Number the connected components (8 neighbours) of each cluster, ``(84, 84)``; 0 is background."""
        return self._components(as_grey(frame)).labels

    def detect(self, frame: Frame | Image) -> Objects:
        """Find the objects of a frame: components of the darkest cluster first, the large ones cut."""
        image = as_grey(frame)
        return cut_components(image, self._components(image), self.crop_size_px)

    def _restored(self) -> None:
        fits = not len(self.centres_) or self.centres_.shape[1] == self._dimension
        if len(self.centres_) > self.config.clusters or not fits:
            raise DataError("the saved detector has other clusters than the configuration")

    @property
    def _dimension(self) -> int:
        return 3 if self.config.position_weight else 1

    def _cluster(self) -> None:
        """Cluster all pixels seen, and see which cluster most of them are in."""
        features = self._features(self._pixels)
        centres = k_means(features, self._counts, self.config.clusters, seed=self.config.seed)
        self.centres_ = centres[np.lexsort(centres.T[::-1])]
        sizes = total(nearest(features, self.centres_), self._counts, len(self.centres_))
        self.background_ = int(sizes.argmax())

    def _numbered(self, image: Image) -> Ints:
        """Return each pixel's grey level or, where places count, level and place as one number, ``(7056,)``."""
        levels = image.ravel().astype(np.int64)
        return levels * _PIXELS + np.arange(_PIXELS) if self.config.position_weight else levels

    def _features(self, pixels: Ints) -> NDArray[np.float64]:
        """Return what tells ``(n,)`` numbered pixels apart, ``(n, 1)`` or ``(n, 3)``."""
        if not self.config.position_weight:
            return pixels[:, None].astype(np.float64)
        levels, places = np.divmod(pixels, _PIXELS)
        ways = np.stack(np.divmod(places, IMAGE_SIZE_PX), axis=1) / (IMAGE_SIZE_PX - 1)
        return np.column_stack([levels, self.config.position_weight * ways])

    def _components(self, image: Image) -> Components:
        clusters = self.segment(image)
        others = [c for c in range(len(self.centres_)) if c != self.background_]
        return _joined([connected_components((clusters == c).astype(np.uint8), 0.0) for c in others], image.shape)


def _joined(found: list[Components], shape: tuple[int, ...]) -> Components:
    """Number the components of several clusters one after the other."""
    ends = np.cumsum([0, *(len(each.boxes_px) for each in found)]).tolist()
    labels = np.zeros(shape, np.int32)
    for each, start in zip(found, ends, strict=False):
        labels += np.where(each.labels > 0, each.labels + np.int32(start), np.int32(0))
    return Components(
        labels=labels,
        boxes_px=np.concatenate([np.zeros((0, 4), np.int64), *(each.boxes_px for each in found)]),
        places_px=np.concatenate([np.zeros((0, 2), np.int32), *(each.places_px for each in found)]),
        owners=np.concatenate(
            [np.zeros(0, np.int32), *(each.owners + np.int32(start) for each, start in zip(found, ends, strict=False))]
        ),
    )
