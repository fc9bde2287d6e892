"""The reinforcement-learning agent (§3.3)."""

from semrl.agent.config import DQNConfig
from semrl.agent.dqn import DQN
from semrl.agent.networks import NetworkConfig
from semrl.agent.tabular import QLearning, QLearningConfig

__all__ = ["DQN", "DQNConfig", "NetworkConfig", "QLearning", "QLearningConfig"]
