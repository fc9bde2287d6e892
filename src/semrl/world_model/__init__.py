"""What comes next: the thesis's pair of models, and regression trees (§3.4.3)."""

from semrl.world_model.experience import EpisodeRecord, Experience
from semrl.world_model.model_pair import ModelPair, ModelPairConfig, roll_forward
from semrl.world_model.next_state import NextStateConfig, NextStateNetwork
from semrl.world_model.reward import RewardConfig, RewardNetwork, RewardSVM, make_reward_model
from semrl.world_model.tree_world import TreesConfig, TreeWorld

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
    "TreeWorld",
    "TreesConfig",
    "make_reward_model",
    "roll_forward",
]
