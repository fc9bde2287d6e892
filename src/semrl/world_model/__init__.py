"""What comes next: the thesis's pair of models, and regression trees (§3.4.3)."""

from semrl.core.registry import Registry
from semrl.world_model.experience import EpisodeRecord, Experience
from semrl.world_model.model_pair import ModelPair, ModelPairConfig, roll_forward
from semrl.world_model.next_state import NextStateConfig, NextStateNetwork
from semrl.world_model.protocol import WorldModel
from semrl.world_model.reward import RewardConfig, RewardNetwork, RewardSVM, make_reward_model
from semrl.world_model.tree_world import TreesConfig, TreeWorld

WORLD_MODELS: Registry[WorldModel] = Registry(
    "world_models", {"networks": "semrl.world_model:ModelPair", "trees": "semrl.world_model:TreeWorld"}
)

__all__ = [
    "WORLD_MODELS",
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
    "WorldModel",
    "make_reward_model",
    "roll_forward",
]
