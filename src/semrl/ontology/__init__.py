"""What was seen of the world, as a graph, and what comes next (§3.4.1, §3.4.3)."""

from semrl.ontology.experience import EpisodeRecord, Experience
from semrl.ontology.model_pair import ModelPair, ModelPairConfig, roll_forward
from semrl.ontology.next_state import NextStateConfig, NextStateNetwork
from semrl.ontology.reward import RewardConfig, RewardNetwork, RewardSVM, make_reward_model
from semrl.ontology.state_map import StateMap, StateMapConfig
from semrl.ontology.tree_world import TreesConfig, TreeWorld

__all__ = [
    "EpisodeRecord",
    "Experience",
    "ModelPair",
    "ModelPairConfig",
    "NextStateConfig",
    "NextStateNetwork",
    "RewardConfig",
    "RewardNetwork",
    "RewardSVM",
    "StateMap",
    "StateMapConfig",
    "TreeWorld",
    "TreesConfig",
    "make_reward_model",
    "roll_forward",
]
