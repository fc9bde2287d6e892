"""A state: what an agent is shown of one observation, and what can be reasoned about."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from semrl.core.named import Floats, Ints
from semrl.core.things import no_things


@dataclass(frozen=True, kw_only=True, slots=True)
class State:
    """One observation, elevated."""

    vector: NDArray[Any]
    """What a network is shown: an image, ``(84, 84)`` uint8, or a vector, ``(d,)`` float32."""
    facts: Floats = field(default_factory=lambda: np.zeros(0, np.float32))
    """``(k,)`` float32, the numbers that map, world model and planner work with; empty for images."""
    things: Floats = field(default_factory=no_things)
    """``(n, 9)`` float32, all that is seen and followed, see `semrl.core.things`; none where nothing is followed."""
    lists: tuple[Floats, ...] = ()
    """``(h, k)`` each, the newest facts, the newest first, once for each of several things that share a place in them;
    empty where each has its own."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StateSpace:
    """What all states of an encoder have in common."""

    shape: tuple[int, ...]
    dtype: DTypeLike = np.float32
    """Of `State.vector`."""
    n_facts: int = 0
    """Length of `State.facts`."""
    names: tuple[str, ...] = ()
    """Of the facts, where they have names; of slots only those in use, so there may be fewer than facts."""
    axes: Ints | None = None
    """``(n_facts,)`` int64: 0 and 1 for x and y, 2 and 3 for width and height, −1 for all else; None where that is not
    known."""
    seen: Ints | None = None
    """``(n_facts,)`` int64: which fact says whether the thing that each is about is seen; None where all always are."""
    unit: float | None = None
    """In which unit facts are shown to people: what 1 means in it, as a share of their range; None: as they are."""
    has_things: bool = False
    """Whether states list things that are followed."""

    @property
    def fact_names(self) -> tuple[str, ...]:
        """What facts are called, by their number where they have no names."""
        return self.names or tuple(f"number {i}" for i in range(self.n_facts))


@dataclass(frozen=True, kw_only=True, slots=True)
class AgentObservation:
    """What an agent decides by."""

    vectors: NDArray[Any]
    """``(2, *shape)``, the vector of the state and that of the state before; at the first decision twice the same."""
    plan: Floats = field(default_factory=lambda: np.zeros(0, np.float32))
    """``(p,)`` float32, the features of the plan (§3.4.4); zeros where there is no plan, none without a planner."""
