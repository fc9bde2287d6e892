"""What a detector must offer."""

from typing import Protocol, Self, runtime_checkable

from semrl.core import Frame, Ints, Objects, Observation
from semrl.core.protocols import Persistent
from semrl.perception.detection.ground import Ground


class Detector(Persistent, Protocol):
    """Finds the objects of a frame (§3.2.1)."""

    crop_size_px: int
    """Side of the square crops of objects, in pixels of the 84×84 image."""

    @property
    def frames_needed(self) -> int:
        """How many frames `partial_fit` wants before the detector is fitted."""
        ...

    @property
    def is_fitted(self) -> bool:
        """Whether enough frames were seen."""
        ...

    def partial_fit(self, frame: Frame) -> Self:
        """Learn from one more RGB frame, ``(height, width, 3)`` uint8, until there are enough.

        Raises
        ------
        DataError
            It is no such frame, or not of the size of those before.
        """
        ...

    def detect(self, frame: Frame) -> Objects:
        """Find the objects of a frame; learns nothing.

        Raises
        ------
        DataError
            No frame was learned from yet, or as `partial_fit`.
        """
        ...

    def components(self, frame: Frame) -> Ints:
        """Number the connected regions that objects are cut from, ``(84, 84)``; 0 is background."""
        ...


@runtime_checkable
class ReadsLabels(Protocol):
    """A detector that takes objects from what the environment says of them; it is asked this in place of `detect`."""

    def read(self, observation: Observation) -> Objects:
        """Return the objects that the environment labels.

        Raises
        ------
        UsageError
            The environment labels nothing.
        """
        ...


@runtime_checkable
class KnowsGround(Protocol):
    """A detector that knows, once it is fitted, what stands still."""

    def ground(self) -> Ground:
        """Return the still things, found in the background."""
        ...
