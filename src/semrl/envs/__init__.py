"""What there is to see and to do: environments, frames, RAM (§3.1)."""

from semrl.envs.actions import action_meanings, rom_name
from semrl.envs.environment import EnvironmentConfig, make_env
from semrl.envs.game import Game, Played, observation_of
from semrl.envs.ram import ram_feature_names, ram_features

__all__ = [
    "EnvironmentConfig",
    "Game",
    "Played",
    "action_meanings",
    "make_env",
    "observation_of",
    "ram_feature_names",
    "ram_features",
    "rom_name",
]
