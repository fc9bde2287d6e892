"""Training: a run and its folder, its configuration, the loop in which everything learns."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

if TYPE_CHECKING:
    from semrl.training.config import PRESETS, EvaluationConfig, RunConfig, preset
    from semrl.training.folder import RunFolder
    from semrl.training.parts import build_trainer
    from semrl.training.session import TrainResult, train

_HOME = {
    "PRESETS": "semrl.training.config",
    "EvaluationConfig": "semrl.training.config",
    "RunConfig": "semrl.training.config",
    "RunFolder": "semrl.training.folder",
    "TrainResult": "semrl.training.session",
    "build_trainer": "semrl.training.parts",
    "preset": "semrl.training.config",
    "train": "semrl.training.session",
}

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

__getattr__, __dir__ = lazily(__name__, _HOME)
