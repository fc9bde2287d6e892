"""Fast Downward (Helmert 2006) as a second planner, by way of unified-planning: the extra ``pddl``."""

import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from semrl.core.errors import MissingExtraError
from semrl.planning.symbolic.operators import Operator, Operators
from semrl.planning.symbolic.pddl import operator_of


def fast_downward(operators: Operators, domain: str, problem: str) -> list[Operator] | None:
    """Return the operators of a plan, which need not be the shortest; None where none was found.

    Parameters
    ----------
    operators
        Those that the domain was written from.
    domain, problem
        PDDL, see `write_domain` and `write_problem`.

    Raises
    ------
    MissingExtraError
        When the extra is not installed.
    """
    try:
        from unified_planning.io import PDDLReader
        from unified_planning.shortcuts import OneshotPlanner, get_environment
    except ImportError:
        raise MissingExtraError("pddl", "planning with Fast Downward") from None
    get_environment().credits_stream = None
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        files = [Path(folder) / "domain.pddl", Path(folder) / "problem.pddl"]
        for file, text in zip(files, (domain, problem), strict=True):
            file.write_text(text, encoding="utf-8")
        read: Any = PDDLReader().parse_problem(*map(str, files))
        with OneshotPlanner(name="fast-downward") as planner:
            result: Any = planner.solve(read)
    if result.plan is None:
        return None
    names: Sequence[str] = [step.action.name for step in result.plan.actions]
    return [operator_of(operators, name) for name in names]
