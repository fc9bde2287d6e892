"""What a trained run can do, and why it does it: scores, accuracy of its world model, explanations, videos."""

from semrl.evaluation.explaining import explain
from semrl.evaluation.explanation import Explanation
from semrl.evaluation.maps import LoadedMap, load_map
from semrl.evaluation.player import load_encoder, load_player
from semrl.evaluation.scores import EvaluationResult, evaluate

__all__ = [
    "EvaluationResult",
    "Explanation",
    "LoadedMap",
    "evaluate",
    "explain",
    "load_encoder",
    "load_map",
    "load_player",
]
