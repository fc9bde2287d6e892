"""What every stateful part of the architecture offers."""

from typing import Protocol, runtime_checkable

from semrl.core.arrays import Arrays


@runtime_checkable
class Persistent(Protocol):
    """Something whose learned state goes out and in as named arrays."""

    def to_arrays(self) -> Arrays:
        """Return everything that was learned; restoring it gives the same behaviour, bit for bit."""
        ...

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured component returned."""
        ...


@runtime_checkable
class Learner(Persistent, Protocol):
    """Something of which a part is needed for learning alone, so that a player can do without."""

    def inference_arrays(self) -> Arrays:
        """Return the part of `to_arrays` that is enough to play; `from_arrays` takes that as well."""
        ...
