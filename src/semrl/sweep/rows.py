"""What is reported of the runs of a sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semrl.evaluation.statistics import Profile

TRAINING = "training"
"""Score of a run that is not tested: its last training episodes."""


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """A finished run, as a line of ``rows.jsonl``."""

    id: str
    model: str
    game: str
    variant: str
    seed: int
    """Which."""
    decisions: int
    episodes: int
    seconds: float
    """Of its training."""
    worker: str
    """Who ended it, ``HOST:PID``."""
    returns: Mapping[str, Sequence[float]]
    """Of its last ten training episodes (``training``) and of each test (``agent``, ``planner``)."""
    state: str
    weights: str
    """Digests of what it has learned: equal for equal runs on one kind of machine."""


@dataclass(frozen=True, kw_only=True)
class CellSummary:
    """Scores of the runs that differ in their seed alone: interquartile mean, and its 95 % interval if there is one."""

    game: str
    agent: str
    runs: int
    iqm: float | None
    low: float | None
    high: float | None
    means: tuple[float, ...]
    """Mean return of each run, in the order of seeds."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """All that a sweep came to."""

    measure: str
    """Which returns are summed up: ``agent``, ``planner`` or ``training``."""
    cells: tuple[CellSummary, ...]
    """In the order of the file."""
    profiles: Mapping[str, Mapping[str, Profile]]
    """For each game, and for all of them together (``all games``) where the file has references: agent → profile."""
