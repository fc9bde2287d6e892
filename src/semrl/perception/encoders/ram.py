"""Coordinates read from the emulator's RAM: the models `ram` and `ram-map` (§3.1)."""

from collections.abc import Sequence

from semrl.core import Observation, Sight, State, StateSpace
from semrl.core.arrays import Arrays
from semrl.envs import ram_feature_names, ram_features
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders.single_frames import SingleFrames
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import Stage


class RamEncoder:
    """Shows the coordinates of a game whose RAM is mapped; nothing is learned.

    Raises
    ------
    UsageError
        When this game's RAM is not mapped.
    """

    perception = None
    is_fitted = True

    def __init__(self, config: PerceptionConfig, *, rom: str | None = None, planning: bool = False) -> None:
        del config, planning
        self.rom = rom
        names = ram_feature_names(rom or "")
        self.space = StateSpace(shape=(len(names),), n_facts=len(names), names=names, unit=1 / 255)

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return none."""
        del config
        return []

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(self._encode, lambda _: Sight())

    def to_arrays(self) -> Arrays:
        """Return nothing."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""

    def _encode(self, observation: Observation) -> State:
        assert observation.ram is not None, "games with mapped RAM have RAM"
        facts = ram_features(self.rom or "", observation.ram)
        return State(vector=facts, facts=facts)
