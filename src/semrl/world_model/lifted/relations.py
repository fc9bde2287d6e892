"""Which things others are related to: the commonest that move, and the ground that matters."""

import numpy as np
from numpy.typing import NDArray

from semrl.concepts import Concepts
from semrl.concepts.scenes import CONCEPT, HEIGHT, WIDTH, X, Y
from semrl.core import Floats, Ints
from semrl.world_model.lifted.features import Kinds

_BORDER_PX = 1.0
"""What reaches no farther in among the things that move is a border."""

_STRAYS = 0.05
"""Share of the places of what moves beyond each border: some are mistakes."""


def relations_of(concepts: Concepts, objects: Floats, most: int) -> tuple[Kinds, Ints]:
    """Choose the families of concepts that things are related to.

    Parameters
    ----------
    concepts
        What the things are.
    objects
        ``(n, 14)``, all that was seen; see `SceneBuilder.objects`.
    most
        Families of things that move.

    Returns
    -------
    kinds
        What the relations are about.
    families
        ``(r,)`` int64: a concept of each family.
    """
    used = np.array([bool(kinds) for kinds in concepts.table_.kinds], np.bool_)
    moving = used & ~concepts.static_
    counts = counts_of(objects, len(concepts))
    totals = np.zeros(len(concepts), np.int64)
    np.add.at(totals, concepts.families_[moving], counts[moving])
    order = np.argsort(-totals, kind="stable")[:most]
    matters = used & (concepts.is_lost_ | (concepts.blocks_ & _are_inside(objects, moving)))
    families = np.concatenate([order[totals[order] > 0], np.unique(concepts.families_[matters])]).astype(np.int64)
    relation_of = np.full(len(concepts), -1, np.int64)
    for relation, family in enumerate(families):
        relation_of[(moving | matters) & (concepts.families_ == family)] = relation
    return Kinds(relation_of, moving, concepts.controlled_ & moving), families


def counts_of(objects: Floats, concepts: int) -> Ints:
    """Return how often things of each concept were seen, ``(c,)``."""
    known = objects[objects[:, CONCEPT] >= 0, CONCEPT].astype(np.int64)
    counts: Ints = np.bincount(known, minlength=concepts)
    return counts


def _are_inside(objects: Floats, moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell of which concepts there are things among those that move, ``(c,)``: where borders are, each knows itself."""
    known = objects[objects[:, CONCEPT] >= 0]
    concepts = known[:, CONCEPT].astype(np.int64)
    middles, halves = known[:, X : Y + 1], known[:, WIDTH : HEIGHT + 1] / 2
    inside = np.zeros(len(moving), np.bool_)
    for number in np.flatnonzero(moving):
        own = concepts == number
        if not own.any():
            continue
        low, high = np.quantile(middles[own], (_STRAYS, 1 - _STRAYS), axis=0)
        overlaps = (np.minimum(middles + halves, high) - np.maximum(middles - halves, low)).min(axis=1)
        inside[concepts[overlaps > _BORDER_PX]] = True
    return inside
