"""Settings of the lifted world model."""

from dataclasses import dataclass

from semrl.core.errors import UsageError


@dataclass(frozen=True, kw_only=True, slots=True)
class LiftedConfig:
    """Settings of `LiftedWorld`."""

    members: int = 4
    """Forests, each grown from its own draw of the play; a reward counts what they predict on average.

    When it is time, the oldest is grown anew."""
    screening: int = 2
    """Forests that are asked about all scenarios, the others about the best quarter alone; 0: all about all."""
    relations: int = 4
    """Most families of concepts that things are related to."""
    draw_share: float = 0.8
    """Share of what was seen that a member is grown from; the first, whose scenes are shown, sees all."""
    least_gain_px2: float = 1.0
    """Squared error of velocities that a cut must take away for each leaf that it adds, in pixels."""
    least_gain: float = 0.3
    """The same of what vanishes, rewards and returns."""
    leaf_things: int = 2
    """Fewest sightings in a leaf."""
    value_leaf_things: int = 20
    """The same for the return expected beyond a scenario, which is learned from those that came."""
    capacity: int = 100_000
    """Decisions remembered, the oldest episodes first to go."""
    most_rows: int = 200_000
    """Most sightings of a concept that its trees are grown from: of more, some are drawn."""
    first_decisions: int = 300
    """Decisions before trees are grown for the first time."""
    new_decisions: int = 100
    """Fewest new decisions before a forest is grown anew, which is after the next reward or the end of the episode."""
    new_share: float = 0.03
    """The same as a share of those that the newest was grown from."""

    def __post_init__(self) -> None:
        for name in ("members", "relations", "leaf_things", "value_leaf_things", "capacity", "most_rows",
                     "first_decisions", "new_decisions"):  # fmt: skip
            if getattr(self, name) < 1:
                raise UsageError(f"lifted.{name} must be 1 or more, not {getattr(self, name)}")
        if not 0 <= self.screening <= self.members:
            raise UsageError(f"lifted.screening must lie in 0 … members, {self.members}, not {self.screening}")
        if not min(self.new_share, self.least_gain, self.least_gain_px2) >= 0:
            raise UsageError("lifted.new_share, least_gain and least_gain_px2 must be 0 or more")
        if not 0 < self.draw_share <= 1:
            raise UsageError(f"lifted.draw_share must lie above 0 and up to 1, not {self.draw_share}")
