"""What comes next: the thesis's pair of models, regression trees, and trees about concepts (§3.4.3)."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily
from semrl.core.registry import Registry

if TYPE_CHECKING:
    from semrl.world_model.config import ModelPairConfig, NextStateConfig, RewardConfig, TreesConfig
    from semrl.world_model.experience import EpisodeRecord, Experience
    from semrl.world_model.lifted import LiftedConfig, LiftedWorld
    from semrl.world_model.lifted.concept_rules import ConceptRules
    from semrl.world_model.model_pair import ModelPair, roll_forward
    from semrl.world_model.next_state import NextStateNetwork
    from semrl.world_model.protocol import WorldModel
    from semrl.world_model.reward import RewardNetwork, RewardSVM, make_reward_model
    from semrl.world_model.tree_world import TreeWorld

WORLD_MODELS: "Registry[WorldModel]" = Registry(
    "world_models",
    {
        "networks": "semrl.world_model:ModelPair",
        "trees": "semrl.world_model:TreeWorld",
        "lifted": "semrl.world_model:LiftedWorld",
    },
)

_HOME = {
    "ConceptRules": "semrl.world_model.lifted.concept_rules",
    "EpisodeRecord": "semrl.world_model.experience",
    "Experience": "semrl.world_model.experience",
    "LiftedConfig": "semrl.world_model.lifted.config",
    "LiftedWorld": "semrl.world_model.lifted.world",
    "ModelPair": "semrl.world_model.model_pair",
    "ModelPairConfig": "semrl.world_model.config",
    "NextStateConfig": "semrl.world_model.config",
    "NextStateNetwork": "semrl.world_model.next_state",
    "RewardConfig": "semrl.world_model.config",
    "RewardNetwork": "semrl.world_model.reward",
    "RewardSVM": "semrl.world_model.reward",
    "TreeWorld": "semrl.world_model.tree_world",
    "TreesConfig": "semrl.world_model.config",
    "WorldModel": "semrl.world_model.protocol",
    "make_reward_model": "semrl.world_model.reward",
    "roll_forward": "semrl.world_model.model_pair",
}

__all__ = [
    "WORLD_MODELS",
    "ConceptRules",
    "EpisodeRecord",
    "Experience",
    "LiftedConfig",
    "LiftedWorld",
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

__getattr__, __dir__ = lazily(__name__, _HOME)
