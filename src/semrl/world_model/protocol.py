"""What a world model must offer (§3.4.3), and the two halves of the thesis's."""

from typing import Protocol, Self

from semrl.core import Floats, Ints, Moment, Scenarios, Trajectory, Transitions
from semrl.core.arrays import Arrays
from semrl.core.protocols import Persistent


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
