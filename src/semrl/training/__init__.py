"""Training: a run and its folder, its configuration, the loop in which everything learns."""

from semrl.training.config import PRESETS, EvaluationConfig, RunConfig, preset
from semrl.training.folder import RunFolder
from semrl.training.parts import build_trainer
from semrl.training.session import TrainResult, train

__all__ = [
    "PRESETS",
    "EvaluationConfig",
    "RunConfig",
    "RunFolder",
    "TrainResult",
    "build_trainer",
    "preset",
    "train",
]
