"""semrl: neuro-symbolic reinforcement learning, from raw frames to an agent that can explain itself."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semrl.observation import SemanticObservation, SemanticVectorObservation
    from semrl.pipeline import Pipeline
    from semrl.runs import evaluate, load_pipeline, preset, train
    from semrl.state import make_env

__version__ = "0.1.0"

_HOME = {
    "Pipeline": "semrl.pipeline",
    "SemanticObservation": "semrl.observation",
    "SemanticVectorObservation": "semrl.observation",
    "evaluate": "semrl.runs",
    "load_pipeline": "semrl.runs",
    "make_env": "semrl.state",
    "preset": "semrl.runs",
    "train": "semrl.runs",
}

__all__ = [
    "Pipeline",
    "SemanticObservation",
    "SemanticVectorObservation",
    "evaluate",
    "load_pipeline",
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
