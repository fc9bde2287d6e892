"""Grounding (§3.4.4): what the agent is told of the plan."""

from semrl.grounding.goal import GoalConfig, GoalPart, goal_size, ground

__all__ = ["GoalConfig", "GoalPart", "goal_size", "ground"]
