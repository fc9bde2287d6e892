"""What embeddings have in common that learn nothing."""

from collections.abc import Sequence
from typing import Self

from semrl.core import SceneGraph
from semrl.core.protocols import Stateless


class Unlearned(Stateless):
    """The part of the protocol `Embedder` that is about learning, for embeddings that are pure functions of a scene.

    Parameters
    ----------
    dimension
        Length of the vectors.
    """

    def __init__(self, dimension: int) -> None:
        self._dimension = dimension

    @property
    def documents_needed(self) -> int:
        """0: there is nothing to learn."""
        return 0

    @property
    def is_fitted(self) -> bool:
        """True: there is nothing to learn."""
        return True

    @property
    def dimension(self) -> int:
        """Length of the vectors."""
        return self._dimension

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:  # noqa: ARG002 - the protocol's signature
        """Do nothing and return ``self``: there is nothing to learn."""
        return self
