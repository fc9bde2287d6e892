"""Cells of a discrete world as symbols: what the actions move, and which appearances mean the same."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from semrl.core import Ints
from semrl.core.errors import UsageError
from semrl.planning.symbolic.appearances import Appearances, Shape
from semrl.planning.symbolic.movers import changes, join, own_kinds, root

OUTSIDE = -1
"""The concept of what lies beyond the world."""

UNKNOWN = -2
"""The concept of an appearance that was never met while learning."""

_FEWEST_SWITCHES = 3
_MOST_CONCEPTS = 128  # a cell is a signed byte


@dataclass(frozen=True, kw_only=True, slots=True)
class GridEpisode:
    """One episode, cell by cell."""

    grids: Ints
    """``(t + 1, rows, columns)``: the kind of each cell."""
    actions: Ints
    """``(t,)``."""
    rewards: Sequence[float]
    """``(t,)``."""
    ended: bool
    """Whether the last decision ended the game, by the game's own rules."""


@dataclass(frozen=True, slots=True)
class GridState:
    """One state as planning has it."""

    row: int
    column: int
    kind: int
    """Where the thing is that the actions move, and how it looks: which way it faces."""
    cells: bytes
    """The concept of each cell, row by row, one signed byte each; under that thing, what was there before."""
    columns: int

    def concept(self, offset: tuple[int, int]) -> int:
        """Return the concept of the cell at an offset from the thing that the actions move."""
        row, column = self.row + offset[0], self.column + offset[1]
        if not (0 <= column < self.columns and 0 <= row < len(self.cells) // self.columns):
            return OUTSIDE
        value = self.cells[row * self.columns + column]
        return value - 256 if value > 127 else value


@dataclass(frozen=True, kw_only=True)
class CellConcepts:
    """Which kinds of cells mean what."""

    own: Mapping[int, int]
    """Kind of the thing that the actions move → the kind that it is when nothing is beneath it: which way it faces."""
    concept_of: Mapping[int, int]
    """Kind of any other cell → its concept."""
    floor: int
    """The concept that was mostly found where that thing had stood."""
    looks: Appearances
    """Of kinds, also of those that were not met while learning."""

    def states(self, grids: Iterable[Ints]) -> Iterator[GridState | None]:
        """Yield the states of an episode; None where what the actions move is not seen."""
        before: GridState | None = None
        for grid in grids:
            state = self.state(grid, before)
            yield state
            before = state or before

    def state(self, grid: Ints, before: GridState | None) -> GridState | None:
        """Return what is seen, given the state before it if any; None where what the actions move is not seen."""
        kinds = np.unique(grid).tolist()
        concepts = np.full(kinds[-1] + 1, UNKNOWN, np.int8)
        concepts[kinds] = [self._concept(kind) for kind in kinds]
        own = [kind for kind in kinds if kind in self.own]
        if not own:  # it may stand on what it was never seen on
            own = [kind for kind in kinds if concepts[kind] == UNKNOWN]
        places = np.argwhere(np.isin(grid, own))
        if len(places) != 1:
            return None
        row, column = map(int, places[0])
        cells = concepts[grid]
        there = row * cells.shape[1] + column
        cells[row, column] = self.floor if before is None else np.frombuffer(before.cells, np.int8)[there]
        kind = self._facing(int(grid[row, column]))
        return GridState(row=row, column=column, kind=kind, cells=cells.tobytes(), columns=cells.shape[1])

    @cached_property
    def _concept_of_shape(self) -> dict[Shape, int]:
        by_shape: dict[Shape, set[int]] = {}
        for kind, concept in self.concept_of.items():
            by_shape.setdefault(self.looks.shape(kind), set()).add(concept)
        return {shape: min(concepts) for shape, concepts in by_shape.items() if shape and len(concepts) == 1}

    def _concept(self, kind: int) -> int:
        """Return the concept of a kind, which may be new: that of what is of the same shape."""
        if kind in self.concept_of:
            return self.concept_of[kind]
        return self._concept_of_shape.get(self.looks.shape(kind), UNKNOWN)

    def _facing(self, kind: int) -> int:
        return self.own[kind] if kind in self.own else self.looks.most_alike(kind, set(self.own.values()))


def learn_concepts(episodes: Sequence[GridEpisode], looks: Appearances) -> CellConcepts:
    """Find what the actions move, and which kinds of cells are one concept.

    What is moved is the one thing of a few kinds that is seen once in each frame and in other places than before. Of
    the others, kinds are one concept when they are of one shape, whatever their colours, and when cells go from one
    to the other and back while it moves: a matter of view, as is light.

    Raises
    ------
    UsageError
        When nothing moves, or there are more concepts than cells can name.
    """
    plays = [episode.grids for episode in episodes]
    seen, single = _counted(plays)
    own = own_kinds(plays, seen, single, looks)
    switches, revealed = Counter[tuple[int, int]](), Counter[int]()
    for changed in changes(plays):
        if not any(a in own for a, _ in changed):
            continue  # it neither moved nor turned, so that what has changed was done by it
        revealed.update(b for a, b in changed if a in own and b not in own)
        switches.update((a, b) for a, b in changed if a not in own and b not in own)
    group = _joined(seen.keys() - own.keys(), switches, single, looks)
    concepts = {kind: place for place, kind in enumerate(sorted(set(group.values())))}
    if len(concepts) > _MOST_CONCEPTS:
        raise UsageError(
            f"{len(concepts)} concepts of cells were found, of which there may be {_MOST_CONCEPTS} at most"
        )
    concept_of = {kind: concepts[first] for kind, first in group.items()}
    floors = Counter(concept_of[kind] for kind in revealed.elements() if kind in concept_of)
    floor = floors.most_common(1)[0][0] if floors else UNKNOWN
    return CellConcepts(own=own, concept_of=concept_of, floor=floor, looks=looks)


def _counted(plays: Iterable[Ints]) -> tuple[Counter[int], set[int]]:
    """Return kind → frames in which it is seen, and the kinds that are seen once at most in each."""
    frames, more = Counter[int](), set[int]()
    for grids in plays:
        for grid in grids:
            counts = Counter(grid.ravel().tolist())
            frames.update(counts.keys())
            more.update(kind for kind, count in counts.items() if count > 1)
    return frames, set(frames) - more


def _joined(
    kinds: set[int], switches: Counter[tuple[int, int]], single: set[int], looks: Appearances
) -> dict[int, int]:
    """Return kind → the first kind of its concept."""
    parent = {kind: kind for kind in kinds}
    of_shape: dict[Shape, int] = {}
    for kind in sorted(kinds):
        if shape := looks.shape(kind):
            join(parent, kind, of_shape.setdefault(shape, kind))
    for (a, b), count in switches.items():
        back = switches[b, a]
        alike = a in kinds and b in kinds and (a in single) == (b in single)
        if alike and back and (a in single or count + back >= _FEWEST_SWITCHES):
            join(parent, a, b)
    return {kind: root(parent, kind) for kind in kinds}
