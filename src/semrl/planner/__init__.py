"""What to do next, near and far (§3.4)."""

from semrl.planner.long_term import LongTermConfig, Routes, edge_costs, edges_along, plan_routes
from semrl.planner.ranking import rank
from semrl.planner.reason import reason
from semrl.planner.short_term import ShortTermConfig, action_sequences

__all__ = [
    "LongTermConfig",
    "Routes",
    "ShortTermConfig",
    "action_sequences",
    "edge_costs",
    "edges_along",
    "plan_routes",
    "rank",
    "reason",
]
