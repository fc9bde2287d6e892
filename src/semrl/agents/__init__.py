"""The reinforcement-learning agent (§3.3)."""

from semrl.agents.config import DQNConfig
from semrl.agents.dqn import DQN
from semrl.agents.networks import NetworkConfig
from semrl.agents.tabular import QLearning, QLearningConfig

__all__ = ["DQN", "DQNConfig", "NetworkConfig", "QLearning", "QLearningConfig"]
