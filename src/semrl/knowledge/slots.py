"""Facts as scenes: what a list of tracked objects, seen or imagined, says in the words of the ontology."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.errors import UsageError
from semrl.knowledge.compiler import entail, role_axioms
from semrl.knowledge.geometry import BORDERS, ROLES, relate
from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.ontology import Ontology

NUMBERS = {
    "x": "Centre, in percent of the image from the left.",
    "y": "Centre, in percent of the image from the top.",
    "vx": "Change of x since the decision before.",
    "vy": "Change of y since the decision before.",
}
"""Data properties of things."""

THING, CONTROLLED, AUTONOMOUS, BORDER = "thing", "controlled", "autonomous", "border"
OWN, FLYING, MOVING = "own", "ball", "other"
"""What things are called by how they move: what the actions move; what flies on along both axes; all others."""

_UPPER = {
    THING: "What moves in the game.",
    CONTROLLED: "A thing that the actions move.",
    AUTONOMOUS: "A thing that moves by itself.",
    BORDER: "An edge of the arena.",
}
_SIZE_PERCENT = 5.0
"""Width and height of a thing before it was measured."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Slot:
    """Which numbers of the facts are about one thing."""

    name: str
    columns: Mapping[str, int]
    """``x``, ``y`` and ``seen``, as far as they are known → place in the facts."""


def slots_of(names: Sequence[str]) -> list[Slot]:
    """Return the things that facts with such names are about: ``own x`` and ``player_y`` are of own and player.

    Raises
    ------
    UsageError
        When the facts hold no places of things.
    """
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        match = re.fullmatch(r"(.+)[ _](x|y|seen)", name)
        if match:
            found.setdefault(re.sub(r"\W", "", match[1]), {})[match[2]] = column
    if not found:
        raise UsageError("the facts of this run do not say where things are, so nothing can be said of them")
    return [Slot(name=name, columns=columns) for name, columns in found.items()]


def kinds_of(slot: Slot, flying: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the classes of the thing in a slot, the most special last.

    Parameters
    ----------
    slot
        The slot.
    flying
        ``(d,)``: which numbers of the facts mostly go on changing as they just did.
    """
    if slot.name.startswith(OWN):
        return THING, CONTROLLED, *dict.fromkeys((OWN, slot.name))
    both = [axis in slot.columns and bool(flying[slot.columns[axis]]) for axis in ("x", "y")]
    return THING, AUTONOMOUS, FLYING if all(both) else MOVING, slot.name


def words_of(slots: Sequence[Slot], kinds: Sequence[Sequence[str]]) -> Ontology:
    """Return the ontology of a list of tracked objects: their classes, how these hang together, roles and numbers."""
    concepts = dict(_UPPER)
    concepts |= {
        kind: f"What is in the slot '{slot.name}'." for slot, of in zip(slots, kinds, strict=True) for kind in of
    }
    concepts |= _UPPER | {
        name: text
        for name, text in {
            OWN: "What the actions move.",
            FLYING: "What flies on along both axes by itself.",
            MOVING: "What moves by itself, but does not fly.",
        }.items()
        if name in concepts
    }
    below = {(low, up) for of in kinds for up, low in pairwise(of)}
    brothers = [
        tuple(sorted({low for low, upper in below if upper == up})) for up in (THING, AUTONOMOUS) if up in concepts
    ]
    return Ontology(
        concepts=concepts,
        parents=tuple(sorted(below)),
        disjoint=((THING, BORDER), *(group for group in brothers if len(group) > 1)),
        roles=ROLES,
        numbers=NUMBERS,
        individuals=dict.fromkeys(BORDERS, BORDER),
        limits=Counter(kind for of in kinds for kind in dict.fromkeys(of)),
    )


class SlotReader:
    """Reads facts as scenes.

    Parameters
    ----------
    slots
        What the facts are about.
    kinds
        The classes of each.
    words
        The ontology, with at least these classes.
    arena
        ``(4,)``, left, top, right and bottom of where things move, in percent.
    percent
        What a fact of 1 is in percent of the image.

    Attributes
    ----------
    sizes : ndarray
        ``(k, 2)``, width and height of each thing in percent; who sees boxes may set them.
    """

    def __init__(
        self,
        slots: Sequence[Slot],
        kinds: Sequence[Sequence[str]],
        words: Ontology,
        *,
        arena: Sequence[float] = (0.0, 0.0, 100.0, 100.0),
        percent: float = 100.0,
    ) -> None:
        self.slots = tuple(slots)
        self.words = words
        self.arena = np.asarray(arena, np.float64)
        self.percent = percent
        self.sizes = np.full((len(slots), 2), _SIZE_PERCENT)
        self._axioms = role_axioms(words)
        concepts = {name: i for i, name in enumerate(words.concepts)}
        n = 1 + len(BORDERS) + len(slots)
        self._classes = np.zeros((len(concepts), n), np.bool_)
        self._classes[concepts[BORDER], 1 : 1 + len(BORDERS)] = True
        for place, of in enumerate(kinds, 1 + len(BORDERS)):
            self._classes[[concepts[kind] for kind in of], place] = True
        self._names = ("", *BORDERS, *(slot.name for slot in slots))

    def read(self, states: Floats, previous: Floats) -> Interpretation:
        """Return ``(b, d)`` facts as scenes, given the facts before them."""
        now, before = self._numbers(states), self._numbers(previous)
        present, seen_before = self._present(states), self._present(previous)
        velocities = np.where((present & seen_before)[..., None], now - before, 0.0)
        b, k = present.shape
        first = 1 + len(BORDERS)
        roles = np.zeros((b, len(self.words.role_names), first + k, first + k), np.bool_)
        there = np.ones((b, first + k), np.bool_)
        there[:, first:] = present
        placed = np.nan_to_num(now, nan=50.0)
        relate(placed, np.nan_to_num(velocities), self.sizes, present, self.arena, roles)
        numbers = np.full((b, len(self.words.numbers), first + k), np.nan)
        numbers[:, :2, first:] = now.transpose(0, 2, 1)
        numbers[:, 2:4, first:] = velocities.transpose(0, 2, 1)
        classes = np.broadcast_to(self._classes, (b, *self._classes.shape)).copy()
        scenes = Interpretation(present=there, classes=classes, roles=roles, numbers=numbers, names=self._names)
        entail(scenes, self._axioms)
        return scenes

    def _numbers(self, states: Floats) -> NDArray[np.float64]:
        """Return x and y of each thing in percent, ``(b, k, 2)``; NaN where that is not known."""
        coordinates = np.full((len(states), len(self.slots), 2), np.nan)
        for place, slot in enumerate(self.slots):
            for axis, name in enumerate(("x", "y")):
                if name in slot.columns:
                    coordinates[:, place, axis] = states[:, slot.columns[name]] * self.percent
        return coordinates

    def _present(self, states: Floats) -> NDArray[np.bool_]:
        columns = [slot.columns.get("seen", -1) for slot in self.slots]
        return np.stack([states[:, c] > 0.5 if c >= 0 else np.ones(len(states), np.bool_) for c in columns], axis=1)
