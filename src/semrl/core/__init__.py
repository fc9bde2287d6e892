"""The nouns that flow through the pipeline: small frozen dataclasses over arrays.

Positions are in pixels of the preprocessed 84×84 image, ``(row, column)``, measured from the top left
corner; a pixel's centre lies at its integer coordinate.
"""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

if TYPE_CHECKING:
    from semrl.core.named import IMAGE_SIZE_PX, NO_ACTION, Floats, Frame, Image, Ints
    from semrl.core.planned import History, MapGraph, Plan, Scenarios, Trajectory, Transitions
    from semrl.core.scene import ConceptTable, Scene
    from semrl.core.seen import Labels, Objects, Observation, Outcome, SceneGraph, Sight, Tracks
    from semrl.core.state import AgentObservation, State, StateSpace

_HOME = {
    "IMAGE_SIZE_PX": "semrl.core.named",
    "NO_ACTION": "semrl.core.named",
    "AgentObservation": "semrl.core.state",
    "ConceptTable": "semrl.core.scene",
    "Floats": "semrl.core.named",
    "Frame": "semrl.core.named",
    "Image": "semrl.core.named",
    "Ints": "semrl.core.named",
    "Labels": "semrl.core.seen",
    "MapGraph": "semrl.core.planned",
    "History": "semrl.core.planned",
    "Objects": "semrl.core.seen",
    "Observation": "semrl.core.seen",
    "Outcome": "semrl.core.seen",
    "Plan": "semrl.core.planned",
    "Scenarios": "semrl.core.planned",
    "Scene": "semrl.core.scene",
    "SceneGraph": "semrl.core.seen",
    "Sight": "semrl.core.seen",
    "State": "semrl.core.state",
    "StateSpace": "semrl.core.state",
    "Tracks": "semrl.core.seen",
    "Trajectory": "semrl.core.planned",
    "Transitions": "semrl.core.planned",
}

__all__ = [
    "IMAGE_SIZE_PX",
    "NO_ACTION",
    "AgentObservation",
    "ConceptTable",
    "Floats",
    "Frame",
    "History",
    "Image",
    "Ints",
    "Labels",
    "MapGraph",
    "Objects",
    "Observation",
    "Outcome",
    "Plan",
    "Scenarios",
    "Scene",
    "SceneGraph",
    "Sight",
    "State",
    "StateSpace",
    "Tracks",
    "Trajectory",
    "Transitions",
]

__getattr__, __dir__ = lazily(__name__, _HOME)
