"""What an encoder must offer: how far up a frame is elevated before an agent sees it (§4.3)."""

from collections.abc import Sequence
from typing import Protocol

from semrl.core import Observation, Sight, State, StateSpace
from semrl.core.protocols import Persistent
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import Stage


class EpisodeEncoder(Persistent, Protocol):
    """An encoder's part in one episode; what it saves is what it remembers from one observation to the next."""

    def encode(self, observation: Observation) -> State:
        """Elevate the next observation of the episode; each is shown once, in order.

        Raises
        ------
        DataError
            When perception has not learned enough yet.
        """
        ...

    def look(self) -> Sight:
        """Return what was seen in the newest observation, as far as perception has learned to see."""
        ...


class Encoder(Persistent, Protocol):
    """Turns observations into states. What is learned is here, what belongs to an episode in what `begin` returns.

    It is made with the configuration of perception; the name of the Atari game, or None; and whether a planner
    reasons about the facts of its states.
    """

    @property
    def rom(self) -> str | None:
        """Name of the Atari game that it looks at; None for other worlds."""
        ...

    @property
    def perception(self) -> Perception | None:
        """The boxes that it looks through; None where it looks at frames or RAM as they are."""
        ...

    @property
    def space(self) -> StateSpace:
        """What its states have in common."""
        ...

    @property
    def is_fitted(self) -> bool:
        """Whether all that it needs is learned."""
        ...

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return what must be learned before it can encode, in order."""
        ...

    def begin(self) -> EpisodeEncoder:
        """Return what encodes a new episode; cheap, and any number may be used side by side."""
        ...
