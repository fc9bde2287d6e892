"""What there is to see and to do: environments, frames, RAM (§3.1)."""

from semrl.envs.environment import EnvironmentConfig, action_meanings, make_env, played_actions, rom_name
from semrl.envs.game import Game, Played, observation_of
from semrl.envs.ram import ram_feature_names, ram_features

__all__ = [
    "EnvironmentConfig",
    "Game",
    "Played",
    "action_meanings",
    "make_env",
    "observation_of",
    "played_actions",
    "ram_feature_names",
    "ram_features",
    "rom_name",
]
