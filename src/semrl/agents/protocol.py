"""What an agent must offer."""

from typing import Any, Protocol

from semrl.core import AgentObservation, Floats
from semrl.core.protocols import Learner


class Agent(Learner, Protocol):
    """Learns to act from rewards (§3.3), and from what a planner advises.

    It is made with its configuration and, by keyword, ``space`` (`StateSpace` of what it is shown), ``plan_size``
    (features of a plan beside it), ``n_actions``, ``seed``, ``budget`` (decisions in all, or None) and ``device``.
    """

    def act(self, shown: AgentObservation, advised: int | None = None) -> int:
        """Choose an action in training; advice, where there is any, stands in for what the agent values most."""
        ...

    def best_action(self, shown: AgentObservation) -> int:
        """Return the action that the agent values most."""
        ...

    def action_values(self, shown: AgentObservation) -> Floats:
        """Return what each action is worth, ``(n_actions,)`` float32; preferences where there are no values."""
        ...

    def observe(
        self,
        shown: AgentObservation,
        action: int,
        reward: float,
        *,
        terminated: bool,
        start: bool,
        advised: int | None = None,
    ) -> None:
        """Take note of one decision, its reward and what the planner advised, and learn when it is time."""
        ...

    def end_episode(self, shown: AgentObservation) -> None:
        """Take note of the last state of an episode, in which nothing was done."""
        ...

    def measured(self) -> dict[str, Any]:
        """Return what there is to report of the learning: columns of the metrics."""
        ...
