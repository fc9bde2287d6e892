"""What encoders share that look at each frame by itself, and of them those that learn nothing."""

from collections.abc import Callable, Sequence

from semrl.core import Observation, Sight, State
from semrl.core.protocols import Stateless
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import Stage


class SingleFrames(Stateless):
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


class AsItIs(Stateless):
    """An encoder that looks through nothing that is learned."""

    perception = None
    is_fitted = True

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return none."""
        del config
        return []


def see_nothing(_: Observation) -> Sight:
    """Return what is seen where no objects are looked for."""
    return Sight()
