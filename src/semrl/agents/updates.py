"""What makes updates of a Q-network must offer."""

from typing import Any, Protocol

from numpy.typing import NDArray

from semrl.agents.replay import Batch
from semrl.core import Floats
from semrl.core.arrays import Arrays


class Updates(Protocol):
    """Lets an online network learn from batches, and a target network follow it."""

    beside_play: bool
    """Whether an update may go on in a thread beside play."""

    def values(self, states: NDArray[Any], plans: Floats) -> Floats:
        """Return what the online network makes of states and plans, ``(b, n_values)`` float32."""
        ...

    def update(self, batch: Batch, learning_rate: float) -> float:
        """Take one gradient step on a batch (eq. 2.1 with the squared error clipped to linear beyond 1).

        Returns
        -------
        float
            The loss. Where it is no number nothing is learned.
        """
        ...

    def renew_target(self) -> None:
        """Move the target network towards the online network."""
        ...

    def to_arrays(self) -> Arrays:
        """Return the moments of Adam."""
        ...

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        ...
