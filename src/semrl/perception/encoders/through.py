"""What encoders share that look through perception."""

from semrl.core.arrays import Arrays
from semrl.perception.config import PerceptionConfig
from semrl.perception.perception import Perception


class ThroughPerception:
    """Holds the boxes and what they have learned.

    Parameters
    ----------
    config
        Of perception.
    rom
        Name of the Atari game that is looked at; None for other worlds.
    planning
        Whether a planner reasons about the facts of states.
    """

    tracked = False
    """Whether objects are followed from decision to decision."""
    embedded = False
    """Whether scenes become vectors."""

    def __init__(self, config: PerceptionConfig, *, rom: str | None = None, planning: bool = False) -> None:
        self.rom = rom
        self.planning = planning
        self.perception = Perception(config, tracked=self.tracked, embedded=self.embedded)

    def to_arrays(self) -> Arrays:
        """Return what was learned."""
        return self.perception.to_arrays()

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was learned."""
        self.perception.from_arrays(arrays)
