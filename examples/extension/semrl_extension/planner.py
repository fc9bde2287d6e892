"""A planner: each action is held for a while in the world model, and the one that brings most is taken."""

from dataclasses import dataclass

import numpy as np

from semrl.core import History, Plan
from semrl.planning import rank
from semrl.planning.protocol import Knowledge


@dataclass(frozen=True, kw_only=True)
class HoldConfig:
    """How far it looks."""

    decisions: int = 4
    """For which each action is held."""


class HoldPlanner:
    """Compares as many scenarios as there are actions."""

    Config = HoldConfig

    def __init__(self, config: HoldConfig, *, n_actions: int, discount: float = 1.0) -> None:
        self.depth = config.decisions
        self.n_actions = n_actions
        self.discount = discount

    def plan(
        self, history: History, knowledge: Knowledge, *, exploring: bool = False, first: int | None = None
    ) -> Plan:
        """Hold every action, or the one that is asked about, and rank what comes of it."""
        actions = np.arange(self.n_actions) if first is None else np.array([first])
        scenarios = knowledge.world_model.imagine(history, np.repeat(actions[:, None], self.depth, axis=1))
        state, previous = history.window(2)
        before_last = scenarios.states[:, -2] if self.depth > 1 else state[None]
        return rank(
            scenarios,
            knowledge.coordinates(state[None], previous[None]),
            knowledge.coordinates(scenarios.states[:, -1], before_last),
            knowledge.state_map,
            knowledge.routes,
            discount=self.discount,
        )
