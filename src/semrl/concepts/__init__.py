"""What things are and how they lie to each other, learned from tracks: concepts, scenes, relations between boxes."""

from semrl.concepts.concepts import Concepts, ConceptsConfig
from semrl.concepts.scenes import SceneBuilder

__all__ = ["Concepts", "ConceptsConfig", "SceneBuilder"]
