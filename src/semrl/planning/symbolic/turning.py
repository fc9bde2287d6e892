"""Ways to face as quarter turns of one another: what was learned facing one way holds facing the others."""

from collections import Counter
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field

import numpy as np

from semrl.planning.symbolic.cells import GridState

Offset = tuple[int, int]
"""Rows down and columns to the right, from the thing that the actions move."""

_TURNS = 4
_MOSTLY = 0.9


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Quarter turns between the ways to face."""

    quarters: Mapping[int, int] = field(default_factory=dict)
    """Kind of the thing that the actions move → quarter turns, against the clock, from the way that stands for all."""

    def of(self, kind: int) -> int:
        """Return the quarter turns of a kind; 0 for what faces no way."""
        return self.quarters.get(kind, 0)

    def stands_for(self, kind: int) -> int:
        """Return the kind that stands for all the ways that a kind is one of."""
        return self.turned_kind(kind, -self.of(kind))

    def turned_kind(self, kind: int, quarters: int) -> int:
        """Return the kind that another becomes when all is turned."""
        if kind not in self.quarters:
            return kind
        wanted = (self.quarters[kind] + quarters) % _TURNS
        return next(one for one, has in self.quarters.items() if has == wanted)

    def turned_state(self, state: GridState) -> GridState:
        """Return a state turned so that it faces the way that stands for all."""
        quarters = self.of(state.kind)
        if not quarters:
            return state
        grid = np.frombuffer(state.cells, np.int8).reshape(-1, state.columns)
        turned = np.rot90(grid, -quarters)
        row, column = state.row, state.column
        rows, columns = grid.shape
        for _ in range(quarters):  # with the clock
            row, column, rows, columns = column, rows - 1 - row, columns, rows
        return GridState(
            row=row,
            column=column,
            kind=self.turned_kind(state.kind, -quarters),
            cells=turned.tobytes(),
            columns=columns,
        )


def turned_offset(offset: Offset, quarters: int) -> Offset:
    """Return an offset after quarter turns against the clock."""
    down, right = offset
    for _ in range(quarters % _TURNS):
        down, right = -right, down
    return down, right


def learn_turning(kinds: Set[int], moves: Iterable[tuple[int, Offset]]) -> Turning:
    """Find the ways to face from where a thing of each kind went: there are four, each straight on along its own way.

    The fourth follows from the three others.

    Parameters
    ----------
    kinds
        All kinds of the thing that the actions move.
    moves
        Its kind before, and where it went from there.
    """
    went: dict[int, Counter[Offset]] = {}
    for kind, move in moves:
        if move != (0, 0):
            went.setdefault(kind, Counter())[move] += 1
    ahead = {kind: ways.most_common(1)[0][0] for kind, ways in went.items()}
    astray = any(ways[ahead[kind]] < _MOSTLY * ways.total() for kind, ways in went.items())
    if astray or len(kinds) != _TURNS or len(ahead) < _TURNS - 1:
        return Turning()
    first = ahead[min(ahead)]
    ways = {turned_offset(first, quarters): quarters for quarters in range(_TURNS)}
    quarters = {kind: ways.get(move, -1) for kind, move in ahead.items()}
    if len(set(quarters.values())) != len(quarters) or -1 in quarters.values():
        return Turning()
    left = set(ways.values()).difference(quarters.values())
    return Turning(quarters=quarters | {kind: left.pop() for kind in kinds - quarters.keys()})
