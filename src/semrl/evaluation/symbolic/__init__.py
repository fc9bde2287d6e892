"""Symbolic plans in discrete worlds: play that is stored as cells, operators learned from it, plans carried out."""

from semrl.evaluation.symbolic.learning import LEARNING_DECISIONS, learn_world
from semrl.evaluation.symbolic.naming import concept_names, read_symbolic_goal
from semrl.evaluation.symbolic.plans import (
    TRIAL_DECISIONS,
    UNSEEN_SEED,
    SymbolicPlanner,
    SymbolicResult,
    play_plans,
    write_pddl,
)
from semrl.evaluation.symbolic.world import PLAY, SymbolicWorld

__all__ = [
    "LEARNING_DECISIONS",
    "PLAY",
    "TRIAL_DECISIONS",
    "UNSEEN_SEED",
    "SymbolicPlanner",
    "SymbolicResult",
    "SymbolicWorld",
    "concept_names",
    "learn_world",
    "play_plans",
    "read_symbolic_goal",
    "write_pddl",
]
