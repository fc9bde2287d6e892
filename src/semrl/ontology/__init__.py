"""What was seen of the world, as a graph, and what comes next (§3.4.1, §3.4.3)."""

from semrl.ontology.experience import EpisodeRecord, Experience, with_past_actions
from semrl.ontology.next_state import NextStateConfig, NextStateNetwork, NextStateTrees, make_next_state_model
from semrl.ontology.reward import RewardConfig, RewardNetwork, RewardSVM, RewardTree, make_reward_model
from semrl.ontology.state_map import StateMap, StateMapConfig

__all__ = [
    "EpisodeRecord",
    "Experience",
    "NextStateConfig",
    "NextStateNetwork",
    "NextStateTrees",
    "RewardConfig",
    "RewardNetwork",
    "RewardSVM",
    "RewardTree",
    "StateMap",
    "StateMapConfig",
    "make_next_state_model",
    "make_reward_model",
    "with_past_actions",
]
