"""semrl: neuro-symbolic reinforcement learning, from raw frames to an agent that can explain itself."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semrl.envs import make_env
    from semrl.evaluation import evaluate, load_encoder
    from semrl.semantic_env import SemanticEnv
    from semrl.training import preset, train
    from semrl.wrappers import SemanticObservation, SemanticVectorObservation

__version__ = "0.1.0"

_HOME = {
    "SemanticEnv": "semrl.semantic_env",
    "SemanticObservation": "semrl.wrappers",
    "SemanticVectorObservation": "semrl.wrappers",
    "evaluate": "semrl.evaluation",
    "load_encoder": "semrl.evaluation",
    "make_env": "semrl.envs",
    "preset": "semrl.training",
    "train": "semrl.training",
}

__all__ = [
    "SemanticEnv",
    "SemanticObservation",
    "SemanticVectorObservation",
    "evaluate",
    "load_encoder",
    "make_env",
    "preset",
    "train",
]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: ``semrl --help`` should not wait for torch."""
    if name not in _HOME:
        raise AttributeError(f"module 'semrl' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)
