"""What a planner must offer."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from semrl.core import Floats, History, Plan
from semrl.planning.long_term import Routes
from semrl.planning.state_map import StateMap
from semrl.world_model.protocol import WorldModel


@dataclass(frozen=True, kw_only=True, slots=True)
class Knowledge:
    """What a planner may plan with."""

    world_model: WorldModel
    """Predicts what actions lead to (§3.4.3)."""
    state_map: StateMap
    routes: Routes
    """The map of states and the ways to gains on it (§3.4.1, §3.4.2)."""
    velocity_weight: float = 0.0
    """What a state's change counts on the map, against 1 for the state; 0: it is left out."""

    def coordinates(self, states: Floats, previous: Floats) -> Floats:
        """Return where ``(b, d)`` states lie on the map, given the states before them."""
        return coordinates(states, previous, self.velocity_weight)


class Planner(Protocol):
    """Decides what to do next with what is known. It learns nothing and remembers nothing.

    It is made with its configuration and, by keyword, ``n_actions`` and ``discount``.
    """

    @property
    def depth(self) -> int:
        """How many actions a plan has."""
        ...

    def plan(
        self, history: History, knowledge: Knowledge, *, exploring: bool = False, first: int | None = None
    ) -> Plan:
        """Plan from where a history ends.

        Parameters
        ----------
        history
            The present state and what led to it.
        knowledge
            World model, map and routes as of now; the world model has learned something.
        exploring
            Whether the plan is to learn by, in a training episode that the planner plays.
        first
            An action with which the plan must begin, for those who ask "why not?"; None leaves it free.
        """
        ...


def coordinates(states: Floats, previous: Floats, velocity_weight: float) -> Floats:
    """Return where ``(b, d)`` states lie on a map: the states and, where they count there, their changes."""
    weight = np.float32(velocity_weight)
    return np.concatenate([states, weight * (states - previous)], axis=1) if weight else states
