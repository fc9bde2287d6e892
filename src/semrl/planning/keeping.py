"""When a plan is kept: as long as what it predicted comes, there is nothing new to ask."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from semrl.core import History, Plan, Scenarios
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.planning.protocol import Knowledge
from semrl.planning.ranking import continued

_REWARD = 0.5  # predicted, from which on one is expected


@dataclass(frozen=True, kw_only=True, slots=True)
class KeepingConfig:
    """How long a plan is kept."""

    decisions: int = 0
    """Most decisions that a plan is kept beyond the one it was made for; 0: a plan is made at every decision."""
    tolerance: float = 0.005
    """By how much a number of the state may differ from what was predicted, in units of the state."""

    def __post_init__(self) -> None:
        if self.decisions < 0:
            raise UsageError(f"keeping.decisions must be 0 or more, not {self.decisions}")
        if not 0 <= self.tolerance < np.inf:
            raise UsageError(f"keeping.tolerance must be 0 or more, not {self.tolerance}")


class PlanKeeper:
    """The plan of an episode while it holds.

    It is given up at an event (a reward, come or predicted), a surprise (another state than was predicted, or another
    action than was planned), after so many decisions, and at its end.

    Parameters
    ----------
    config
        See `KeepingConfig`.
    discount
        What a reward counts one decision later.
    """

    def __init__(self, config: KeepingConfig, *, discount: float) -> None:
        self.config = config
        self.discount = discount
        self._plan: Plan | None = None
        self._age = 0  # decisions since it was made

    def renew(self, plan: Plan | None) -> None:
        """Hold a new plan, or none."""
        self._plan = plan if self.config.decisions else None
        self._age = 0

    def what_is_left(self, history: History, reward: float, knowledge: Knowledge) -> Plan | None:
        """Return what is left of the plan after a decision and its reward; None where a new one is due."""
        plan = self._plan
        if plan is None or self._age >= self.config.decisions or len(plan.actions) < 2 or not len(history.actions):
            return None
        scenarios = plan.scenarios
        if reward or abs(scenarios.rewards[0, 0]) >= _REWARD or history.actions[0] != plan.actions[0]:
            return None
        state, previous = history.window(2)
        if np.abs(state - scenarios.states[0, 0]).max() > self.config.tolerance:
            return None
        start = knowledge.coordinates(state[None], previous[None])
        self._plan = continued(plan, start, knowledge.state_map, knowledge.routes, discount=self.discount)
        self._age += 1
        return self._plan

    def to_arrays(self) -> Arrays:
        """Return the plan, if there is one."""
        plan = self._plan
        if plan is None:
            return {}
        scenarios = {name: getattr(plan.scenarios, name) for name in Scenarios.__dataclass_fields__}
        return {
            "age": np.array(self._age),
            "node": np.array(plan.node),
            "path": plan.path,
            "returns": plan.returns,
            "end_nodes": plan.end_nodes,
            "progress": plan.progress,
            "seeks_novelty": np.array(plan.seeks_novelty),
            **nest(scenarios={name: array for name, array in scenarios.items() if array is not None}),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on with what `to_arrays` returned."""
        self.renew(None)
        if not arrays:
            return
        scenarios: dict[str, Any] = unnest(arrays, "scenarios")
        self._age = int(arrays["age"])
        self._plan = Plan(
            node=int(arrays["node"]),
            path=arrays["path"],
            scenarios=Scenarios(**scenarios),
            returns=arrays["returns"],
            end_nodes=arrays["end_nodes"],
            progress=arrays["progress"],
            seeks_novelty=bool(arrays["seeks_novelty"]),
        )
