"""What encoders share that look at each frame by itself."""

from collections.abc import Callable

from semrl.core import Observation, Sight, State
from semrl.core.arrays import Arrays


class SingleFrames:
    """An episode in which nothing is remembered from one observation to the next.

    Parameters
    ----------
    encode, look
        What is made of one observation.
    """

    def __init__(self, encode: Callable[[Observation], State], look: Callable[[Observation], Sight]) -> None:
        self._encode = encode
        self._look = look
        self._newest: Observation | None = None

    def encode(self, observation: Observation) -> State:
        """Elevate one observation."""
        self._newest = observation
        return self._encode(observation)

    def look(self) -> Sight:
        """Return what was seen in it."""
        return Sight() if self._newest is None else self._look(self._newest)

    def to_arrays(self) -> Arrays:
        """Return nothing, which is what is remembered."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Remember nothing."""
