"""What an embedder must offer."""

from collections.abc import Sequence
from typing import Protocol, Self, runtime_checkable

from semrl.core import Floats, SceneGraph
from semrl.core.protocols import Persistent


class Embedder(Persistent, Protocol):
    """Writes a scene graph as a vector (§3.2.3)."""

    @property
    def documents_needed(self) -> int:
        """How many scenes `fit` wants before `transform` works; 0 when nothing is learned."""
        ...

    @property
    def dimension(self) -> int:
        """Length of the vectors."""
        ...

    @property
    def is_fitted(self) -> bool:
        """Whether `transform` works."""
        ...

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:
        """Learn from scenes, all at once."""
        ...

    def transform(self, graph: SceneGraph) -> Floats:
        """Return the vector, ``(dimension,)`` float32, zeros for a scene without objects; learns nothing.

        Raises
        ------
        DataError
            If a centre is not finite or too far away.
        UsageError
            If there is something to learn and nothing was learned yet.
        """
        ...


@runtime_checkable
class OnlineEmbedder(Embedder, Protocol):
    """An embedder that learns from one scene after the other, so that none need be kept."""

    def partial_fit(self, graph: SceneGraph) -> Self:
        """Learn from one more scene."""
        ...
