"""The goal: the best scenario as a fixed vector, which stands next to the state that the agent sees (§3.4.4)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from semrl.core import Floats, Plan
from semrl.core.errors import UsageError

GoalPart = Literal["actions", "state", "reward"]


@dataclass(frozen=True, kw_only=True, slots=True)
class GoalConfig:
    """What the agent is told of the plan; the default is all that the thesis lists."""

    parts: tuple[GoalPart, ...] = ("actions", "state", "reward")
    """Of the best scenario: the actions, the state it is predicted to end in, its predicted return."""
    decisions: int = 0
    """How many of its actions are told, from the first; 0: all."""

    def __post_init__(self) -> None:
        if not self.parts or len(set(self.parts)) < len(self.parts):
            raise UsageError(f"goal.parts must name at least one part, each once, not {self.parts}")
        if self.decisions < 0:
            raise UsageError(f"goal.decisions must be 0 or more, not {self.decisions}")


def goal_size(config: GoalConfig, *, dimension: int, depth: int, n_actions: int) -> int:
    """Return the length of the goal vector for states of ``dimension`` numbers and scenarios of ``depth`` actions."""
    told = min(config.decisions or depth, depth)
    sizes = {"actions": told * n_actions, "state": dimension, "reward": 1}
    return sum(sizes[part] for part in config.parts)


def ground(plan: Plan, config: GoalConfig, *, n_actions: int) -> Floats:
    """Write the best scenario of a plan as a vector.

    Parameters
    ----------
    plan
        What the planner proposes.
    config
        Which parts, in which order.
    n_actions
        Number of actions; each is told as so many numbers, a 1 among zeros.

    Returns
    -------
    ndarray
        `goal_size` float32.
    """
    chosen = plan.actions[: config.decisions or None]
    parts = {
        "actions": np.eye(n_actions, dtype=np.float32)[chosen].ravel(),
        "state": plan.scenarios.states[0, -1],
        "reward": plan.returns[:1].astype(np.float32),
    }
    return np.concatenate([parts[part] for part in config.parts], dtype=np.float32)
