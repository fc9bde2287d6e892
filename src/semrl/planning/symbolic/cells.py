"""Cells of a discrete world as symbols: what the actions move, and which appearances mean the same."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.errors import UsageError

OUTSIDE = -1
"""The concept of what lies beyond the world."""

UNKNOWN = -2
"""The concept of an appearance that was never met while learning."""

_FEWEST_SWITCHES = 3


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

    own: frozenset[int]
    """Kinds of the thing that the actions move."""
    concept_of: Mapping[int, int]
    """Kind of any other cell → its concept."""
    floor: int
    """The concept that was mostly found where that thing had stood."""

    def states(self, grids: Ints) -> Iterator[GridState | None]:
        """Yield the states of an episode; None where what the actions move is not seen."""
        concepts = np.full(max([*grids.ravel().tolist(), *self.concept_of], default=0) + 1, UNKNOWN, np.int8)
        concepts[list(self.concept_of)] = list(self.concept_of.values())
        before: NDArray[np.int8] | None = None
        for grid in grids:
            cells = concepts[grid]
            places = np.argwhere(np.isin(grid, list(self.own)))
            if len(places) != 1:
                yield None
                continue
            row, column = map(int, places[0])
            cells[row, column] = self.floor if before is None else before[row, column]
            before = cells
            yield GridState(
                row=row,
                column=column,
                kind=int(grid[row, column]),
                cells=cells.tobytes(),
                columns=cells.shape[1],
            )


def learn_concepts(episodes: Sequence[GridEpisode]) -> CellConcepts:
    """Find what the actions move, and which kinds of cells are one concept.

    What is moved is the one thing of a few kinds that is seen once in each frame and in other places than before. Of
    the others, kinds are one concept when cells go from one to the other and back while it moves: a matter of view,
    as is light.

    Raises
    ------
    UsageError
        When nothing moves.
    """
    frames = [grid for episode in episodes for grid in episode.grids]
    most = Counter[int]()
    for grid in frames:
        kinds, counts = np.unique(grid, return_counts=True)
        for kind, count in zip(kinds.tolist(), counts.tolist(), strict=True):
            most[kind] = max(most[kind], count)
    single = {kind for kind, count in most.items() if count == 1}
    own = _own_kinds(episodes, single)
    switches, revealed = Counter[tuple[int, int]](), Counter[int]()
    for before, after in _pairs(episodes):
        was, now = np.isin(before, list(own)), np.isin(after, list(own))
        if not (before[was] != after[was]).any():
            continue  # it neither moved nor turned, so that what has changed was done by it
        revealed.update(after[was & ~now].tolist())
        plain = (before != after) & ~was & ~now
        switches.update(zip(before[plain].tolist(), after[plain].tolist(), strict=True))
    group = _joined(most.keys() - own, switches, single)
    concepts = {kind: place for place, kind in enumerate(sorted(set(group.values())))}
    concept_of = {kind: concepts[first] for kind, first in group.items()}
    floors = Counter(concept_of[kind] for kind in revealed.elements() if kind in concept_of)
    return CellConcepts(own=own, concept_of=concept_of, floor=floors.most_common(1)[0][0] if floors else UNKNOWN)


def _pairs(episodes: Sequence[GridEpisode]) -> Iterator[tuple[Ints, Ints]]:
    for episode in episodes:
        yield from pairwise(episode.grids)


def _own_kinds(episodes: Sequence[GridEpisode], single: set[int]) -> frozenset[int]:
    """Return the kinds of the thing that moves most, and those that are only seen where none of these is."""
    moves, turns = Counter[tuple[int, int]](), Counter[tuple[int, int]]()
    for before, after in _pairs(episodes):
        cells = np.argwhere(before != after)
        for row, column in cells.tolist():
            a, b = int(before[row, column]), int(after[row, column])
            if a in single and b in single:
                turns[a, b] += 1
            elif b in single:
                left = [
                    int(before[r, c]) for r, c in cells.tolist() if before[r, c] in single and after[r, c] not in single
                ]
                if len(left) == 1:
                    moves[left[0], b] += 1
    parent = {kind: kind for kind in single}
    for a, b in [*moves, *(pair for pair in turns if pair[::-1] in turns)]:
        _join(parent, a, b)
    moved = Counter[int]()
    for (_, b), count in moves.items():
        moved[_root(parent, b)] += count
    if not moved:
        raise UsageError("nothing moved that the actions could have moved, so there is nothing to plan with")
    best = moved.most_common(1)[0][0]
    own = {kind for kind in single if _root(parent, kind) == best}
    with_it, without = set[int](), set[int]()
    for episode in episodes:
        for grid in episode.grids:
            (with_it if np.isin(grid, list(own)).any() else without).update(np.unique(grid).tolist())
    return frozenset(own | (without - with_it))


def _joined(kinds: set[int], switches: Counter[tuple[int, int]], single: set[int]) -> dict[int, int]:
    """Return kind → the first kind of its concept."""
    parent = {kind: kind for kind in kinds}
    for (a, b), count in switches.items():
        back = switches[b, a]
        alike = a in kinds and b in kinds and (a in single) == (b in single)
        if alike and back and (a in single or count + back >= _FEWEST_SWITCHES):
            _join(parent, a, b)
    return {kind: _root(parent, kind) for kind in kinds}


def _join(parent: dict[int, int], a: int, b: int) -> None:
    low, high = sorted((_root(parent, a), _root(parent, b)))
    parent[high] = low


def _root(parent: Mapping[int, int], kind: int) -> int:
    while parent[kind] != kind:
        kind = parent[kind]
    return kind
