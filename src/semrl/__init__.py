"""semrl: neuro-symbolic reinforcement learning, from raw frames to an agent that can explain itself."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

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

__getattr__, __dir__ = lazily(__name__, _HOME)
