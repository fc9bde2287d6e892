"""The reinforcement-learning agent (§3.3)."""

from semrl.agents.config import DQNConfig
from semrl.agents.dqn import DQN
from semrl.agents.networks import NetworkConfig
from semrl.agents.protocol import Agent
from semrl.agents.tabular import QLearning, QLearningConfig
from semrl.core.registry import Registry

AGENTS: Registry[Agent] = Registry("agents", {"dqn": "semrl.agents.dqn:DQN"})

__all__ = ["AGENTS", "DQN", "Agent", "DQNConfig", "NetworkConfig", "QLearning", "QLearningConfig"]
