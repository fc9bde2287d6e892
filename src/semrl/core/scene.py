"""A scene in concepts: what relations, events, rules, classes and goals are about."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core.named import Floats, Ints


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """The things of one decision, each of a concept."""

    ids: Ints
    """``(n,)`` int64: the identity of each, never given twice in an episode."""
    concepts: Ints
    """``(n,)`` int64: the concept of each, as numbered in `ConceptTable`."""
    kinds: Ints
    """``(n,)`` int64: the class number (§3.2.2) that each was seen with last."""
    boxes_px: Floats
    """``(n, 4)`` float32: left, top, right and bottom in the 84×84 image, the last two exclusive."""
    velocities_px: Floats
    """``(n, 2)`` float32: to the right and down, a decision."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, kw_only=True, slots=True)
class ConceptTable:
    """The concepts of a run: what its things are, as learned from play."""

    names: tuple[str, ...]
    """One word each, unique: ``own``, ``object2`` for what has that slot to itself, ``concept7``, ``still3``."""
    controlled: NDArray[np.bool_]
    """``(c,)``: whether its things answer to actions."""
    static: NDArray[np.bool_]
    """``(c,)``: whether its things stay where they are."""
    kinds: tuple[tuple[int, ...], ...]
    """The class numbers that are of each concept."""
    arena_px: Floats
    """``(4,)`` float32: left, top, right and bottom of where things move."""

    def __len__(self) -> int:
        return len(self.names)
