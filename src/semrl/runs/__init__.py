"""Runs in a folder: configuration, checkpoints, metrics, evaluation."""

from semrl.runs.config import PRESETS, EvaluationConfig, RunConfig, preset
from semrl.runs.evaluation import EvaluationResult, evaluate
from semrl.runs.explaining import explain
from semrl.runs.explanation import Explanation
from semrl.runs.folder import RunFolder
from semrl.runs.maps import LoadedMap, load_map
from semrl.runs.player import load_pipeline, load_player
from semrl.runs.session import TrainResult, build_trainer, train

__all__ = [
    "PRESETS",
    "EvaluationConfig",
    "EvaluationResult",
    "Explanation",
    "LoadedMap",
    "RunConfig",
    "RunFolder",
    "TrainResult",
    "build_trainer",
    "evaluate",
    "explain",
    "load_map",
    "load_pipeline",
    "load_player",
    "preset",
    "train",
]
