"""What rules may say of a thing: the literals of decision lists (see `semrl.world_model.lifted.decision_lists`)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.world_model.lifted.features import N_OWN, N_RELATION, RELATION_NAMES, TOUCHING_NEXT, Kinds

Mask = NDArray[np.bool_]

_EDGE_PX, _FARTHEST = 1.0, 0.9995  # share of the places beyond an edge: some are mistakes
_STRAYS = 0.05  # share of the places at each end that do not tell whether it keeps its place
_EDGES = (("left", -1), ("top", -1), ("right", 1), ("bottom", 1))
_GAPS, _APART, _CLOSING = (
    [RELATION_NAMES.index(name) for name in names]
    for names in (("gap x", "gap y"), ("dx", "dy"), ("relative vx", "relative vy"))
)
_TOUCHING = RELATION_NAMES.index("touching")


class About(NamedTuple):
    """A concept of which rules are read, and what it is related to."""

    concept: int
    name: str
    kinds: Kinds
    families: Sequence[str]
    """Names of the families that relations are about."""
    autonomous: Sequence[bool]
    """Whether things of each of them move, and not by actions."""

    @property
    def controlled(self) -> bool:
        """Whether its things are moved by actions."""
        return bool(self.kinds.controlled[self.concept])


class Vocabulary:
    """Literals about the things of one concept.

    Parameters
    ----------
    about
        The concept.
    rows
        ``(n, f)``, see `semrl.world_model.lifted.features.describe`: where its edges lie is read from them. Along an
        axis that it keeps its place on there are none.
    """

    def __init__(self, about: About, rows: Floats) -> None:
        self.about = about
        self._edges: list[tuple[str, int, int, float]] = []
        for k, (name, way) in enumerate(_EDGES):
            places = way * rows[:, 6 + k]
            if np.diff(np.quantile(places, (_STRAYS, 1 - _STRAYS))) > 2 * _EDGE_PX:
                self._edges.append((name, 10 + k, way, float(np.quantile(places, _FARTHEST))))

    def literals(self, rows: Floats) -> dict[str, Mask]:
        """Return what may be said of ``(n, f)`` rows, and of which of them it is true."""
        said: dict[str, Mask] = {
            f"it is beyond its {name} edge next": way * rows[:, column] - farthest >= -_EDGE_PX
            for name, column, way, farthest in self._edges
        }
        others = np.zeros(len(rows), np.bool_)
        for k, family in enumerate(self.about.families):
            begin = N_OWN + N_RELATION * k
            part = rows[:, begin : begin + N_RELATION]
            touches = said[f"it touches {family} next"] = _touches(part)
            there = part[:, 0] > 0.5
            said[f"no {family} is level with it"] = ~there | (part[:, 2] > 0)
            if self.about.autonomous[k]:
                others |= touches
        if self.about.controlled and sum(self.about.autonomous) > 1:
            said["it touches what moves by itself next"] = others
        for name, axis in (("to the right", 0), ("down", 1)):
            said[f"it goes {name}"] = rows[:, axis] > 0
        return said


def _touches(part: Floats) -> Mask:
    """Tell whether there is contact within a decision; what touches and draws apart already is no contact to come."""
    axis = np.argmax(part[:, _GAPS], axis=1)[:, None]
    apart, closing = (np.take_along_axis(part[:, columns], axis, 1)[:, 0] for columns in (_APART, _CLOSING))
    parts = (part[:, _TOUCHING] > 0.5) & (apart * closing > 0)
    touches: Mask = (part[:, TOUCHING_NEXT] > 0.5) & ~parts
    return touches
