"""What a reducer must offer."""

from typing import Any, Protocol, Self

from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.protocols import Persistent


class Reducer(Persistent, Protocol):
    """Describes objects by fewer numbers (§3.2.2)."""

    revision: object
    """Another one whenever what `transform` returns may have changed."""

    @property
    def dimension(self) -> int:
        """How many numbers describe an object."""
        ...

    @property
    def is_fitted(self) -> bool:
        """Whether enough was learned for `transform`."""
        ...

    def partial_fit(self, X: Floats) -> Self:
        """Learn from the ``(n, k)`` objects of one frame.

        Raises
        ------
        DataError
            Rows are not finite, or not as long as those seen before or as is needed; nothing is learned then.
        """
        ...

    def transform(self, X: Floats) -> Floats:
        """Return ``(n, dimension)`` float32; learns nothing.

        Raises
        ------
        DataError
            Too little was learned yet, or as `partial_fit`.
        """
        ...

    def inverse_transform(self, X: NDArray[Any]) -> Floats:
        """Return the ``(n, k)`` objects that are described so, as far as that can be undone."""
        ...
