"""The reinforcement-learning agent (§3.3)."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily
from semrl.core.registry import Registry

if TYPE_CHECKING:
    from semrl.agents.config import DQNConfig, NetworkConfig
    from semrl.agents.dqn import DQN
    from semrl.agents.protocol import Agent

AGENTS: "Registry[Agent]" = Registry("agents", {"dqn": "semrl.agents.dqn:DQN"})

_HOME = {
    "DQN": "semrl.agents.dqn",
    "Agent": "semrl.agents.protocol",
    "DQNConfig": "semrl.agents.config",
    "NetworkConfig": "semrl.agents.config",
}

__all__ = ["AGENTS", "DQN", "Agent", "DQNConfig", "NetworkConfig"]

__getattr__, __dir__ = lazily(__name__, _HOME)
