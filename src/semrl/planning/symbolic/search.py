"""A* over operators (Hart, Nilsson and Raphael 1968)."""

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count

from semrl.core.errors import UsageError
from semrl.planning.symbolic.cells import GridState
from semrl.planning.symbolic.operators import Operator, Operators

MAX_STATES = 200_000
"""After so many states the search gives up."""

Place = tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True)
class SymbolicGoal:
    """What is sought: an event, a place, or to stand where something is."""

    event: str = ""
    """``gain`` or ``end``."""
    place: Place | None = None
    """Row and column."""
    concept: int | None = None
    """What is to be stood on."""

    def reached(self, operator: Operator | None, before: GridState | None, state: GridState) -> bool:
        """Tell whether an operator, and the state that it led to, are what is sought."""
        if self.event:
            effect = operator.effect if operator else None
            return effect is not None and (effect.gain > 0 if self.event == "gain" else effect.ends)
        if self.place is not None:
            return (state.row, state.column) == self.place
        moved = before is None or (before.row, before.column) != (state.row, state.column)
        return moved and state.concept((0, 0)) == self.concept


@dataclass(frozen=True, kw_only=True, slots=True)
class SymbolicPlan:
    """A plan, and what it leads through."""

    operators: tuple[Operator, ...]
    states: tuple[GridState, ...]
    """One more than operators, the present one first."""

    def __len__(self) -> int:
        return len(self.operators)


def search(operators: Operators, start: GridState, goal: SymbolicGoal, most: int = MAX_STATES) -> SymbolicPlan | None:
    """Return a plan with the fewest operators; None where there is none among so many states.

    The distance to the nearest place where the goal could be met, in longest steps, is what is left at least, as long
    as no cell comes to be such a place on the way.
    """
    longest = max((sum(map(abs, one.effect.move)) for one in operators.operators), default=0) or 1
    targets = _targets(operators, start, goal)

    def left(state: GridState) -> int:
        if not targets:
            return 0
        return min(-(-(abs(state.row - row) + abs(state.column - column)) // longest) for row, column in targets)

    if targets is not None and not targets:
        return None
    return _best_first(operators, start, goal.reached, left, most)


def nearest(
    operators: Operators, start: GridState, wanted: Callable[[GridState], bool], most: int = MAX_STATES
) -> SymbolicPlan | None:
    """Return the shortest plan to a state that is wanted; None where there is none among so many states."""
    return _best_first(operators, start, lambda _operator, _before, state: wanted(state), lambda _state: 0, most)


def follow(operators: Operators, start: GridState, actions: Sequence[Operator]) -> SymbolicPlan:
    """Return a plan of somebody else's with what it leads through.

    Raises
    ------
    UsageError
        When an operator does not apply; the message names the step.
    """
    states = [start]
    for number, operator in enumerate(actions):
        states.append(_after(operators, states[-1], operator, number))
    return SymbolicPlan(operators=tuple(actions), states=tuple(states))


def validate(operators: Operators, plan: SymbolicPlan, goal: SymbolicGoal) -> None:
    """Carry a plan out in mind, step by step.

    Raises
    ------
    UsageError
        When an operator does not apply, leads elsewhere, or the goal is not met at the end; the message names the step.
    """
    state, before, last = plan.states[0], None, None
    for number, (operator, expected) in enumerate(zip(plan.operators, plan.states[1:], strict=True)):
        if _after(operators, state, operator, number) != expected:
            raise UsageError(f"step {number} of the plan leads elsewhere than the plan says")
        before, state, last = state, expected, operator
    if not goal.reached(last, before, state):
        raise UsageError("the plan does not reach the goal")


def _after(operators: Operators, state: GridState, operator: Operator, number: int) -> GridState:
    outcomes = dict(operators.successors(state))
    if operator not in outcomes:
        raise UsageError(f"step {number} of the plan cannot be taken: its conditions do not hold")
    return outcomes[operator]


def _best_first(
    operators: Operators,
    start: GridState,
    reached: Callable[[Operator | None, GridState | None, GridState], bool],
    left: Callable[[GridState], int],
    most: int = MAX_STATES,
) -> SymbolicPlan | None:
    if reached(None, None, start):
        return SymbolicPlan(operators=(), states=(start,))
    order = count()  # of equal ones the first
    came: dict[GridState, tuple[GridState, Operator]] = {}
    steps = {start: 0}
    ends: dict[GridState, tuple[GridState, Operator]] = {}
    waiting: list[tuple[int, int, GridState, bool]] = [(left(start), next(order), start, False)]
    while waiting and len(steps) < most:
        _, _, state, done = heapq.heappop(waiting)
        if done:
            before, operator = ends[state]
            return _traced(before, came, operator, state)
        for operator, after in operators.successors(state):
            if reached(operator, state, after):
                known = ends.get(after)
                if known is None or steps[known[0]] > steps[state]:
                    ends[after] = state, operator
                    heapq.heappush(waiting, (steps[state] + 1, next(order), after, True))
            elif not operator.effect.ends and steps[state] + 1 < steps.get(after, MAX_STATES):
                steps[after] = steps[state] + 1
                came[after] = state, operator
                heapq.heappush(waiting, (steps[after] + left(after), next(order), after, False))
    return None


def _traced(
    state: GridState, came: dict[GridState, tuple[GridState, Operator]], last: Operator, end: GridState
) -> SymbolicPlan:
    operators, states = [last], [end, state]
    while state in came:
        state, operator = came[state]
        operators.append(operator)
        states.append(state)
    return SymbolicPlan(operators=tuple(operators[::-1]), states=tuple(states[::-1]))


def _targets(operators: Operators, start: GridState, goal: SymbolicGoal) -> set[Place] | None:
    """Return where a goal could be met as cells are now; None where that could be anywhere."""
    if goal.place is not None:
        return {goal.place}
    if goal.concept is not None:
        made = any(goal.concept == concept for one in operators.operators for _, concept in one.effect.changes)
        return None if made else set(_places(start, goal.concept))
    found: set[Place] = set()
    for operator in operators.operators:
        if not goal.reached(operator, None, start):
            continue
        near = [(ask, answer) for ask, answer in operator.when if isinstance(ask, tuple) and answer >= 0]
        if not near:
            return None
        for (down, right), concept in near[:1]:
            found |= {
                (row - down + operator.effect.move[0], column - right + operator.effect.move[1])
                for row, column in _places(start, concept)
            }
    return found


def _places(state: GridState, concept: int) -> Iterator[Place]:
    for place, value in enumerate(state.cells):
        if value == concept % 256:
            yield divmod(place, state.columns)
