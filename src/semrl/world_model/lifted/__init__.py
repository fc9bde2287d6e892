"""The lifted world model: one model a concept, shared by its instances, over relative features."""

from semrl.world_model.lifted.config import LiftedConfig
from semrl.world_model.lifted.world import LiftedWorld

__all__ = ["LiftedConfig", "LiftedWorld"]
