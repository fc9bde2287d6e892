"""What every stateful part of the architecture offers."""

import copy
from typing import Protocol, runtime_checkable

import numpy as np

from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import DataError


@runtime_checkable
class Persistent(Protocol):
    """Something whose learned state goes out and in as named arrays."""

    def to_arrays(self) -> Arrays:
        """Return everything that was learned; restoring it gives the same behaviour, bit for bit."""
        ...

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured component returned.

        Raises
        ------
        DataError
            Arrays are missing, or do not fit the configuration or each other; nothing is taken over then.
        """
        ...


@runtime_checkable
class Learner(Persistent, Protocol):
    """Something of which a part is needed for learning alone, so that a player can do without."""

    def inference_arrays(self) -> Arrays:
        """Return the part of `to_arrays` that is enough to play; `from_arrays` takes that as well."""
        ...


class Stateless:
    """Something that learns and remembers nothing: `Persistent` by saying so."""

    def to_arrays(self) -> Arrays:
        """Return nothing: there is no state."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""


class Saved:
    """Something whose learned state is in some of its attributes.

    An array is called like its attribute without the underscores around it, those of a part stand behind its name.
    """

    SAVED: tuple[str, ...] = ()
    """Attributes that are arrays, or numbers, which are arrays of no axis."""
    PARTS: tuple[str, ...] = ()
    """Attributes that are `Persistent` themselves."""

    def to_arrays(self) -> Arrays:
        """Return copies of all that was learned; restoring them gives the same behaviour, bit for bit."""
        parts = {name.strip("_"): getattr(self, name).to_arrays() for name in self.PARTS}
        return {name.strip("_"): np.array(getattr(self, name)) for name in self.SAVED} | nest(**parts)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over copies of what `to_arrays` of an equally configured one returned."""
        if missing := {name.strip("_") for name in self.SAVED} - arrays.keys():
            raise DataError(f"what was saved of {type(self).__name__} lacks {', '.join(sorted(missing))}")
        new = copy.copy(self)
        for name in self.SAVED:
            array = arrays[name.strip("_")]
            setattr(new, name, array.copy() if array.ndim else array.item())
        for name in self.PARTS:
            getattr(new, name).from_arrays(unnest(arrays, name.strip("_")))
        new._restored()
        vars(self).update(vars(new))

    def _restored(self) -> None:
        """Check what was restored, raise `DataError` where it does not fit, and renew what follows from it."""
