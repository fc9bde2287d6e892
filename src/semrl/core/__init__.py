"""The nouns that flow through the pipeline: small frozen dataclasses over arrays.

Positions are in pixels of the preprocessed 84×84 image, ``(row, column)``, measured from the top left
corner; a pixel's centre lies at its integer coordinate.
"""

from semrl.core.named import IMAGE_SIZE_PX, NO_ACTION, Floats, Frame, Image, Ints
from semrl.core.planned import MapGraph, Moment, Plan, Scenarios, Trajectory, Transitions
from semrl.core.seen import Objects, Observation, Outcome, SceneGraph, Sight, Tracks
from semrl.core.state import AgentObservation, State, StateSpace

__all__ = [
    "IMAGE_SIZE_PX",
    "NO_ACTION",
    "AgentObservation",
    "Floats",
    "Frame",
    "Image",
    "Ints",
    "MapGraph",
    "Moment",
    "Objects",
    "Observation",
    "Outcome",
    "Plan",
    "Scenarios",
    "SceneGraph",
    "Sight",
    "State",
    "StateSpace",
    "Tracks",
    "Trajectory",
    "Transitions",
]
