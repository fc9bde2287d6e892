"""Coordinates read from the emulator's RAM: the models `ram` and `ram-map` (§3.1)."""

from semrl.core import Observation, State, StateSpace
from semrl.envs import ram_feature_names, ram_features
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders.single_frames import AsItIs, SingleFrames, see_nothing


class RamEncoder(AsItIs):
    """Shows the coordinates of a game whose RAM is mapped; nothing is learned.

    Raises
    ------
    UsageError
        When this game's RAM is not mapped.
    """

    def __init__(self, config: PerceptionConfig, *, rom: str | None = None, planning: bool = False) -> None:
        del config, planning
        self.rom = rom
        names = ram_feature_names(rom or "")
        self.space = StateSpace(shape=(len(names),), n_facts=len(names), names=names, unit=1 / 255)

    def begin(self) -> SingleFrames:
        """Begin an episode."""
        return SingleFrames(self._encode, see_nothing)

    def _encode(self, observation: Observation) -> State:
        assert observation.ram is not None, "games with mapped RAM have RAM"
        facts = ram_features(self.rom or "", observation.ram)
        return State(vector=facts, facts=facts)
