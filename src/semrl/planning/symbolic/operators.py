"""Operators of a discrete world: what an action does, and what that depends on."""

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field
from functools import cached_property

from semrl.planning.symbolic.cells import GridState
from semrl.planning.symbolic.turning import Offset, Turning, turned_offset

Ask = Offset | int
"""Of which concept the cell at an offset is; or whether a concept is anywhere."""

Literal = tuple[Ask, int]
"""A question and its answer: the concept; or 1 or 0."""

Trial = tuple[int, int, int, int, int, bool]
"""Action, way to face, a cell that matters and what it holds, a concept and whether that lay anywhere."""

Context = tuple[int, tuple[int, ...], frozenset[int]]
"""The way to face that stands for all, what is in the cells near by that matter, and the concepts that there are."""

Asked = Mapping[tuple[int, int], tuple[Ask, ...]]
"""Action and kind → what their operators ask of a state."""


BESIDE: tuple[Offset, ...] = ((-1, 0), (0, -1), (0, 1), (1, 0))
"""Offsets that may matter while nothing that matters is known."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Effect:
    """What an action does."""

    move: Offset
    kind: int
    """How what the actions move looks then."""
    changes: tuple[tuple[Offset, int], ...] = ()
    """Cells, from where it stood, and the concept that each is of then."""
    gain: int = 0
    """Sign of the reward, where it is not always the same."""
    ends: bool = False
    """Whether the game ends."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Operator:
    """An action under some conditions."""

    action: int
    kind: int
    """How what the actions move looks before."""
    when: tuple[Literal, ...]
    effect: Effect
    support: int
    """Decisions of the play in which it was so."""
    against: int
    """Decisions in which the conditions held and something else came."""


@dataclass(frozen=True, kw_only=True)
class Operators:
    """All operators of a world."""

    operators: tuple[Operator, ...]
    asked: Asked = field(default_factory=dict)
    tried: frozenset[Trial] = frozenset()
    """What was met when an action was taken, see `Operators.met`."""
    concepts: frozenset[int] = frozenset()
    """Of cells, that were met."""
    turning: Turning = field(default_factory=Turning)

    def successors(self, state: GridState) -> Iterator[tuple[Operator, GridState]]:
        """Yield the operators that apply in a state and what they make of it; nothing is made beyond the world."""
        present = signed(state.cells)
        for asks, operators in self._of_kind.get(state.kind, ()):
            operator = operators.get(tuple(answer(state, present, ask) for ask in asks))
            if operator is not None and _stays(state, operator.effect):
                yield operator, applied(state, operator.effect)

    def context(self, state: GridState) -> Context:
        """Return what may matter to any action in a state."""
        near = tuple(state.concept(offset) for offset in self._near(state.kind))
        return self.turning.stands_for(state.kind), near, signed(state.cells)

    def untried(self, context: Context, n_actions: int, since: Set[Trial] = frozenset()) -> list[int]:
        """Return the actions that were never tried where something that may matter was as it is.

        Parameters
        ----------
        context
            Where they would be.
        n_actions
            That there are.
        since
            What was met since the operators were learned.
        """
        return [
            action
            for action in range(n_actions)
            if any(trial not in self.tried and trial not in since for trial in self.met(action, context))
        ]

    def met(self, action: int, context: Context) -> Iterator[Trial]:
        """Yield what is met when an action is taken.

        That is, of each cell that may matter what it holds, together with each concept and whether that lies anywhere:
        as much as two questions can ask.
        """
        kind, near, present = context
        for place, held in enumerate(near):
            yield from ((action, kind, place, held, one, one in present) for one in self.concepts)

    def _near(self, kind: int) -> tuple[Offset, ...]:
        """Return the cells near by that matter to any action."""
        if kind not in self._offsets:
            first = self.turning.stands_for(kind)
            asks = {ask for (_, own), asks in self.asked.items() if own == first for ask in asks}
            near = sorted(ask for ask in asks if isinstance(ask, tuple)) or list(BESIDE)
            self._offsets[kind] = tuple(turned_offset(ask, self.turning.of(kind)) for ask in near)
        return self._offsets[kind]

    @cached_property
    def _offsets(self) -> dict[int, tuple[Offset, ...]]:
        return {}

    @cached_property
    def _of_kind(self) -> dict[int, list[tuple[tuple[Ask, ...], dict[tuple[int, ...], Operator]]]]:
        """Kind → of each action what is asked, and the operator of each answer."""
        found: dict[tuple[int, int, tuple[Ask, ...]], dict[tuple[int, ...], Operator]] = {}
        for one in self.operators:
            asks, answers = tuple(ask for ask, _ in one.when), tuple(value for _, value in one.when)
            found.setdefault((one.kind, one.action, asks), {})[answers] = one
        tables: dict[int, list[tuple[tuple[Ask, ...], dict[tuple[int, ...], Operator]]]] = {}
        for (kind, _, asks), operators in found.items():
            tables.setdefault(kind, []).append((asks, operators))
        return tables


def _stays(state: GridState, effect: Effect) -> bool:
    """Tell whether all cells that an effect changes lie in the world; what moves may leave it."""
    rows = len(state.cells) // state.columns
    return all(
        0 <= state.row + down < rows and 0 <= state.column + right < state.columns
        for (down, right), _ in effect.changes
    )


def applied(state: GridState, effect: Effect) -> GridState:
    """Return the state after an effect."""
    cells = bytearray(state.cells)
    for (down, right), concept in effect.changes:
        cells[(state.row + down) * state.columns + state.column + right] = concept % 256
    return GridState(
        row=state.row + effect.move[0],
        column=state.column + effect.move[1],
        kind=effect.kind,
        cells=bytes(cells),
        columns=state.columns,
    )


def answer(state: GridState, present: frozenset[int], ask: Ask) -> int:
    """Answer a question about a state, given the concepts that there are."""
    return state.concept(ask) if isinstance(ask, tuple) else int(ask in present)


def signed(cells: bytes) -> frozenset[int]:
    """Return the concepts that there are."""
    return frozenset(value - 256 if value > 127 else value for value in set(cells))
