"""Words for what cells hold, and goals in these words."""

import re
from collections.abc import Sequence

import numpy as np

from semrl.core.errors import UsageError
from semrl.planning.symbolic.cells import OUTSIDE, CellConcepts, GridEpisode, GridState
from semrl.planning.symbolic.operators import Operators
from semrl.planning.symbolic.search import SymbolicGoal

_NOWHERE = GridState(row=0, column=0, kind=-1, cells=b"", columns=1)


def concept_names(concepts: CellConcepts, operators: Operators) -> dict[int, str]:
    """Return a name of each concept of cells by what was learned of it: gain, free, solid, outside, and a number."""
    entered: dict[int, int] = {}
    for operator in operators.operators:
        effect = operator.effect
        into = dict(operator.when).get(effect.move)
        if effect.move != (0, 0) and into is not None:
            entered[into] = max(entered.get(into, 0), effect.gain)
    names = {OUTSIDE: "outside"}
    for concept in sorted(set(concepts.concept_of.values())):
        kind = "solid" if concept not in entered else "gain" if entered[concept] > 0 else "free"
        names[concept] = f"{kind}{concept}"
    return names


def read_symbolic_goal(text: str, concepts: CellConcepts, operators: Operators) -> SymbolicGoal:
    """Read a goal: ``gain``, ``end``, a concept of cells, or ``row,column``.

    Raises
    ------
    UsageError
        When it is none of these, or was never met.
    """
    if text in ("gain", "end"):
        goal = SymbolicGoal(event=text)
        if not any(goal.reached(one, None, _NOWHERE) for one in operators.operators):
            raise UsageError(f"the play that was learned from has no {text}, so that none can be planned for")
        return goal
    if match := re.fullmatch(r"\s*(\d+)\s*,\s*(\d+)\s*", text):
        return SymbolicGoal(place=(int(match[1]), int(match[2])))
    names = concept_names(concepts, operators)
    for concept, name in names.items():
        if name == text and concept >= 0:
            return SymbolicGoal(concept=concept)
    known = ", ".join(name for concept, name in names.items() if concept >= 0)
    raise UsageError(f"there is no goal '{text[:60]}'; there are gain, end, row,column such as 3,4, and {known}")


def require_reachable(
    goal: SymbolicGoal, episodes: Sequence[GridEpisode], concepts: CellConcepts, operators: Operators
) -> None:
    """Check that a goal is somewhere that can be entered, as far as the play has shown.

    Raises
    ------
    UsageError
        When the place is outside of the world, or nothing was ever entered that lay there; or nothing of the concept
        was. The message says why.
    """
    names = concept_names(concepts, operators)
    if goal.concept is not None and names[goal.concept].startswith("solid"):
        raise UsageError(f"the goal cannot be had: nothing of {names[goal.concept]} was ever entered")
    if goal.place is None:
        return
    rows, columns = (max(episode.grids.shape[axis] for episode in episodes) for axis in (1, 2))
    row, column = goal.place
    if row >= rows or column >= columns:
        raise UsageError(f"the goal cannot be had: the world has {rows} rows and {columns} columns, counted from 0")
    met = np.unique(np.concatenate([episode.grids[:, row, column] for episode in episodes])).tolist()
    lay = {names[concepts.concept_of[kind]] for kind in met if kind in concepts.concept_of}
    if all(kind in concepts.concept_of for kind in met) and all(name.startswith("solid") for name in lay):
        what = " or ".join(sorted(lay))
        raise UsageError(f"the goal cannot be had: at {row},{column} lay {what} alone, which was never entered")
