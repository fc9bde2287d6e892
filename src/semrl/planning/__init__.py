"""The map of states, and what to do next on it, near and far (§3.4)."""

from semrl.planning.long_term import LongTermConfig, Routes, edge_costs, edges_along, plan_routes
from semrl.planning.ranking import rank
from semrl.planning.reason import reason
from semrl.planning.short_term import ShortTermConfig, action_sequences
from semrl.planning.state_map import StateMap, StateMapConfig

__all__ = [
    "LongTermConfig",
    "Routes",
    "ShortTermConfig",
    "StateMap",
    "StateMapConfig",
    "action_sequences",
    "edge_costs",
    "edges_along",
    "plan_routes",
    "rank",
    "reason",
]
