"""What a box of the architecture must offer, so that any part can be exchanged for another."""

from collections.abc import Sequence
from typing import Protocol, Self, runtime_checkable

from semrl.arrays import Arrays
from semrl.types import Floats, Ints, Moment, Scenarios, SceneGraph, Trajectory, Transitions


@runtime_checkable
class Persistent(Protocol):
    """Something whose learned state goes out and in as named arrays."""

    def to_arrays(self) -> Arrays:
        """Return everything that was learned; restoring it gives the same behaviour, bit for bit."""
        ...

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured component returned."""
        ...


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

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:
        """Learn from scenes, all at once."""
        ...

    def transform(self, graph: SceneGraph) -> Floats:
        """Return the vector, ``(dimension,)`` float32; learns nothing."""
        ...


class DynamicsModel(Persistent, Protocol):
    """Predicts what state comes next (§3.4.3)."""

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        ...

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return the next state for each of ``(b, d)`` states, the ones before them and ``(b,)`` actions."""
        ...


class RewardModel(Persistent, Protocol):
    """Predicts the sign of the reward (§3.4.3)."""

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        ...

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Ints:
        """Return −1, 0 or 1 for each of ``(b, d)`` states, the ones before them and ``(b,)`` actions."""
        ...


class WorldModel(Persistent, Protocol):
    """Foresees what actions lead to (§3.4.3)."""

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned yet."""
        ...

    def partial_fit(self, trajectory: Trajectory) -> dict[str, float]:
        """Learn from an episode after its end; return columns of the metrics."""
        ...

    def revise(self, so_far: Trajectory) -> None:
        """Learn from the episode that is going on, when that is worth while; what it shows is not kept."""
        ...

    def imagine(self, moment: Moment, sequences: Ints) -> Scenarios:
        """Foresee what ``(s, t)`` sequences of actions lead to."""
        ...

    def load(self, arrays: Arrays) -> None:
        """Take over what is needed to foresee, and no more."""
        ...
