"""Two trained runs beside each other: rows that say what each knows, scores and does."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from semrl.core import Frame
from semrl.world_model.rules import Rule

Interval = tuple[float, float | None, float | None]
"""A mean, and the ends of its 95 % interval where there is one."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Words:
    """Words that both use, and those of one alone."""

    both: tuple[str, ...]
    first: tuple[str, ...]
    second: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class RuleComparison:
    """Rules of the second run beside those of the first; they are paired where they depend on the same numbers."""

    same: int
    """Pairs that say the same."""
    lost: tuple[Rule, ...]
    """Of the first run alone."""
    added: tuple[Rule, ...]
    """Of the second run alone."""
    changed: tuple[tuple[Rule, Rule], ...]
    """Pairs with another value."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MapComparison:
    """Two maps."""

    nodes: tuple[int, int]
    edges: tuple[int, int]
    met: tuple[int, int]
    """Nodes of each in the game that both watched."""
    agreement: float | None
    """Adjusted mutual information of the nodes that the states of that game fall into: 1 when both maps divide them
    alike, 0 when one division says nothing of the other; None where no game was watched with plans."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """Evaluations of one kind."""

    name: str
    """Of their files."""
    episodes: tuple[int, int]
    iqm: tuple[Interval | None, Interval | None]
    """Interquartile mean of the returns; None where one run was not evaluated so."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Decider:
    """What one of them would do, and why."""

    action: str
    values: Mapping[str, float]
    """The agent's value of each action."""
    planned: str | None
    """First action of the best scenario; None without a plan."""
    predicted_return: float | None
    reason: str | None
    """Why that scenario is the best."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Parting:
    """A decision at which they part, after they had agreed."""

    step: int
    """Decision of the game, from 0."""
    return_so_far: float
    frame: Frame
    deciders: tuple[Decider, Decider]


@dataclass(frozen=True, kw_only=True, slots=True)
class Comparison:
    """Two runs compared."""

    runs: tuple[str, str]
    models: tuple[str, str]
    decisions: tuple[int, int]
    """Which, and how long each was trained."""
    settings: Mapping[str, tuple[Any, Any]]
    """Those that differ, by dotted name."""
    names: Words
    concepts: Words
    """Of the numbers that each reasons about, and of the things that it knows."""
    rules: RuleComparison
    maps: MapComparison | None
    scores: tuple[Score, ...]
    """See their classes; maps are None unless both have one."""
    policy: str
    seed: int | None
    watched: int
    """Who decided in the game that the first played while the second looked on, its seed, and its decisions."""
    agreed: float | None
    """Share of these in which both would do the same."""
    partings: tuple[Parting, ...]
    """The first decisions at which they part; up to the first of them each would have played the same game alone."""
    no_game: str
    """Why they could not watch the same one; empty when they did."""

    def to_dict(self) -> dict[str, Any]:
        """Return it without pictures, as JSON has it."""
        partings = [
            {name: value for name, value in asdict(parting).items() if name != "frame"} for parting in self.partings
        ]
        return {**asdict(self), "partings": partings}
