"""From things to scenes: each of a concept, whole where the arena's edge hides a part, and with a velocity."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from semrl.concepts.concepts import Concepts
from semrl.concepts.counting import labels_of
from semrl.core import Floats, Ints, Scene
from semrl.core.kernels import compiled
from semrl.core.things import GROUND, ID, KIND, LEFT, SLOT, STILL, no_things

CONCEPT, X, Y, WIDTH, HEIGHT, VX, VY, VX_1, VY_1, VX_2, VY_2, AGE, IDENTITY, PLACE = range(14)
"""Columns of an object: concept (−1: none any more), centre and size of its whole box, velocity, those one and two
decisions ago, for how many decisions it is known (4 at most), identity, and its slot in the list of tracked objects."""

OBJECT_NUMBERS = 14
_OLDEST = 4
_HIDDEN_PX = 0.11  # what is shorter by less is whole: places are known to a tenth


class Typical(NamedTuple):
    """What is known of concepts, as compiled code reads it."""

    number_of: Ints
    sizes_px: Floats
    bounds_px: Floats


class SceneBuilder:
    """Makes objects and scenes of the things of an episode.

    Parameters
    ----------
    concepts
        What the things are.
    """

    def __init__(self, concepts: Concepts) -> None:
        self.concepts = concepts

    def objects(self, things: Floats, ends: Ints, fresh: Ints) -> Floats:
        """Return the objects, ``(n, 14)`` float32, of the things of decisions one after the other; see `CONCEPT`.

        Parameters
        ----------
        things
            ``(n, 9)`` float32, see `semrl.core.things`.
        ends
            ``(t,)`` int64: where those of each decision end.
        fresh
            ``(t,)`` int64, 1 for the first decision of an episode.
        """
        c = self.concepts
        return objects_of(things, ends, fresh, Typical(c.number_of_, c.sizes_px_, c.bounds_px_))

    def newest(self, things: Sequence[Floats]) -> Floats:
        """Return the objects of the newest decision, given the things of some, the newest first."""
        shown = list(things[: _OLDEST + 1])[::-1]
        rows = np.concatenate([no_things(), *shown])
        fresh = np.zeros(len(shown), np.int64)
        fresh[:1] = 1
        objects = self.objects(rows, np.cumsum([len(part) for part in shown], dtype=np.int64), fresh)
        return objects[len(objects) - len(shown[-1]) :] if shown else objects

    def scene(self, things: Sequence[Floats]) -> Scene:
        """Return the scene of the newest decision, given the things of some, the newest first."""
        objects = self.newest(things)
        known = np.flatnonzero(objects[:, CONCEPT] >= 0)
        shown = objects[known]
        half = shown[:, WIDTH : HEIGHT + 1] / 2
        centres = shown[:, X : Y + 1]
        kinds = things[0][known, KIND] if len(things) else np.zeros(0)
        return Scene(
            ids=shown[:, IDENTITY].astype(np.int64),
            concepts=shown[:, CONCEPT].astype(np.int64),
            kinds=kinds.astype(np.int64),
            boxes_px=np.concatenate([centres - half, centres + half], axis=1),
            velocities_px=shown[:, VX : VY + 1].copy(),
        )


@compiled
def objects_of(things: Floats, ends: Ints, fresh: Ints, typical: Typical) -> Floats:
    """Make objects of things; see `SceneBuilder.objects`."""
    objects = np.zeros((len(things), OBJECT_NUMBERS), np.float32)
    labels = labels_of(things)
    old_begin, begin = 0, 0
    for t in range(len(ends)):
        for i in range(begin, ends[t]):
            before = -1
            if not fresh[t]:
                for j in range(old_begin, begin):
                    if things[j, ID] == things[i, ID]:
                        before = j
            label = labels[i]
            concept = typical.number_of[label] if label < len(typical.number_of) else -1
            if concept < 0 and before >= 0:  # a rare look: it is what it was
                concept = int(objects[before, CONCEPT])
            objects[i, CONCEPT], objects[i, IDENTITY], objects[i, PLACE] = concept, things[i, ID], things[i, SLOT]
            _complete(objects[i], things[i], -1 if things[i, STILL] == GROUND else concept, typical)
            if before >= 0:
                _move(objects[i], objects[before])
            if things[i, STILL] == GROUND:  # where a piece is lost what is left of it does not move
                objects[i, VX : VY_2 + 1] = 0
        old_begin, begin = begin, ends[t]
    return objects


@compiled
def _complete(one: Floats, thing: Floats, concept: int, typical: Typical) -> None:
    """Write centre and size, as if nothing were hidden behind an edge of the arena."""
    for axis in range(2):
        low, high = thing[LEFT + axis], thing[LEFT + axis + 2]
        if concept >= 0:
            size = typical.sizes_px[concept, axis]
            if high - low < size - _HIDDEN_PX:
                if high >= typical.bounds_px[concept, axis + 2] - _HIDDEN_PX:
                    high = low + size
                elif low <= typical.bounds_px[concept, axis] + _HIDDEN_PX:
                    low = high - size
        one[X + axis], one[WIDTH + axis] = (low + high) / 2, high - low


@compiled
def _move(one: Floats, before: Floats) -> None:
    """Write velocities and age of what was seen at the decision before."""
    one[VX], one[VY] = one[X] - before[X], one[Y] - before[Y]
    for k in range(VX_1, VY_2 + 1):
        one[k] = before[k - 2]
    one[AGE] = min(before[AGE] + 1, _OLDEST)
