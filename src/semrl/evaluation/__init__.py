"""What a trained run can do, and why it does it: scores, accuracy of its world model, explanations, videos."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

if TYPE_CHECKING:
    from semrl.evaluation.explaining import explain
    from semrl.evaluation.explanation import Explanation
    from semrl.evaluation.maps import LoadedMap, load_map
    from semrl.evaluation.player import load_encoder, load_player
    from semrl.evaluation.scores import EvaluationResult, evaluate

_HOME = {
    "EvaluationResult": "semrl.evaluation.scores",
    "Explanation": "semrl.evaluation.explanation",
    "LoadedMap": "semrl.evaluation.maps",
    "evaluate": "semrl.evaluation.scores",
    "explain": "semrl.evaluation.explaining",
    "load_encoder": "semrl.evaluation.player",
    "load_map": "semrl.evaluation.maps",
    "load_player": "semrl.evaluation.player",
}

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

__getattr__, __dir__ = lazily(__name__, _HOME)
