"""Plan features: the best scenario as a fixed vector, which stands beside the state that the agent sees (§3.4.4)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from semrl.core import Floats, Plan
from semrl.core.errors import UsageError

PlanFeature = Literal["actions", "state", "reward"]


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanFeaturesConfig:
    """What the agent is shown of the plan; the default is all that the thesis lists."""

    parts: tuple[PlanFeature, ...] = ("actions", "state", "reward")
    """Of the best scenario: the actions, the state it is predicted to end in, its predicted return."""
    decisions: int = 0
    """How many of its actions are shown, from the first; 0: all."""

    def __post_init__(self) -> None:
        if not self.parts or len(set(self.parts)) < len(self.parts):
            raise UsageError(f"plan_features.parts must name at least one part, each once, not {self.parts}")
        if self.decisions < 0:
            raise UsageError(f"plan_features.decisions must be 0 or more, not {self.decisions}")


class PlanFeatures:
    """Writes the best scenario of a plan as a vector.

    Parameters
    ----------
    config
        Which parts, in which order.
    dimension
        Length of the facts.
    depth
        Actions of a scenario.
    n_actions
        Number of actions; each is shown as so many numbers, a 1 among zeros.
    """

    def __init__(self, config: PlanFeaturesConfig, *, dimension: int, depth: int, n_actions: int) -> None:
        self.config = config
        self.n_actions = n_actions
        shown = min(config.decisions or depth, depth)
        sizes = {"actions": shown * n_actions, "state": dimension, "reward": 1}
        self._shown = shown
        self._sizes = {part: sizes[part] for part in config.parts}

    @property
    def size(self) -> int:
        """Length of the vector."""
        return sum(self._sizes.values())

    def ground(self, plan: Plan) -> Floats:
        """Write the best scenario of a plan, ``(size,)`` float32."""
        chosen = plan.actions[: self._shown]
        if len(chosen) < self._shown:  # what is left of a plan ends sooner: its last action is held
            chosen = np.append(chosen, np.full(self._shown - len(chosen), chosen[-1]))
        parts = {
            "actions": np.eye(self.n_actions, dtype=np.float32)[chosen].ravel(),
            "state": plan.scenarios.states[0, -1],
            "reward": plan.returns[:1].astype(np.float32),
        }
        return np.concatenate([parts[part] for part in self.config.parts], dtype=np.float32)

    def parts(self, features: Floats) -> Mapping[str, Floats]:
        """Take the vector apart: name of each part → its numbers."""
        ends = np.cumsum(list(self._sizes.values()))[:-1]
        return dict(zip(self._sizes, np.split(features, ends), strict=True))
