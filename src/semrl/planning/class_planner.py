"""Planning with classes of scenes: scenarios are worth more or less by the classes that they enter."""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, History, Plan
from semrl.planning.judged import JudgedPlanner
from semrl.planning.protocol import Knowledge, Planner
from semrl.planning.ranking import reordered


class SceneJudge(Protocol):
    """Knows what imagined scenes are worth."""

    def worth(self, states: Floats, start: Floats) -> NDArray[np.float64]:
        """Return what each of ``(s, t, d)`` imagined states that follow the state ``(d,)`` is worth, ``(s, t)``."""
        ...


class ClassPlanner(JudgedPlanner[SceneJudge]):
    """Adds to the return of each scenario what its scenes are worth, and ranks anew.

    Parameters
    ----------
    planner
        Imagines scenarios, and ranks them by reward.
    judge
        Tells what scenes are worth.
    discount
        What a scene counts one decision later.

    Attributes
    ----------
    decisions, changed : int
        How many plans were made, and how many of them begin with another action than they would without the judge.
    """

    def __init__(self, planner: Planner, judge: SceneJudge, *, discount: float) -> None:
        super().__init__(planner, judge)
        self.discount = discount
        self.decisions = 0
        self.changed = 0

    def plan(
        self, history: History, knowledge: Knowledge, *, exploring: bool = False, first: int | None = None
    ) -> Plan:
        """Plan from where a history ends; see `Planner.plan`. Of equal scenarios the first stays first."""
        plan = self.planner.plan(history, knowledge, exploring=exploring, first=first)
        worth = self.judge.worth(plan.scenarios.states, history.states[0])  # (s, t)
        weights = self.discount ** np.arange(worth.shape[1], dtype=np.float64)
        returns = plan.returns + (worth * weights).sum(axis=1) / weights.sum()
        best = reordered(replace(plan, returns=returns), np.argsort(-returns, kind="stable"))
        self.decisions += 1
        self.changed += bool(best.actions[0] != plan.actions[0])
        return best
