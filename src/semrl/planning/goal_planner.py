"""Planning for a goal that is given, not learned (§2.5): the same scenarios, ranked by how soon they reach it."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, History, MapGraph, Plan
from semrl.planning.judged import JudgedPlanner
from semrl.planning.long_term import LongTermConfig, Routes, plan_routes
from semrl.planning.protocol import Knowledge, Planner
from semrl.planning.ranking import reordered


@dataclass(frozen=True, kw_only=True, slots=True)
class Verdicts:
    """What each of s scenarios comes to."""

    broken: NDArray[np.int64]
    """``(s,)``: decisions after which something is not kept that must be; one more than imagined where it is."""
    reached: NDArray[np.int64]
    """``(s,)``: decisions after which the goal is reached; one more than imagined where it is not."""
    progress: NDArray[np.float64]
    """``(s,)``: how much is done at the end."""
    distances: NDArray[np.float64]
    """``(s,)``: how far from what is sought next, 0 where it is met."""


class GoalJudge(Protocol):
    """Judges what is imagined by a goal."""

    def judge(self, states: Floats, start: Floats) -> Verdicts:
        """Judge ``(s, t, d)`` imagined states that follow the state ``(d,)``."""
        ...

    def nodes(self, graph: MapGraph) -> NDArray[np.bool_] | None:
        """Return which nodes of a map meet what is sought next, ``(n,)``; None where no place is sought."""
        ...


class GoalPlanner(JudgedPlanner[GoalJudge]):
    """Chooses the scenario that reaches a goal soonest, and where none does, the one that comes closest.

    On the map, nodes that meet the goal are what routes lead to (§3.4.2). The order that the planner of rewards would
    give decides between scenarios that are alike for the goal.

    Parameters
    ----------
    planner
        Imagines scenarios, and ranks them by reward.
    judge
        Knows the goal.
    costs
        What routes cost.
    """

    def __init__(self, planner: Planner, judge: GoalJudge, costs: LongTermConfig) -> None:
        super().__init__(planner, judge)
        self.costs = costs
        self._routes: tuple[MapGraph, bytes, Routes] | None = None  # of which map, to which of its nodes

    def plan(
        self, history: History, knowledge: Knowledge, *, exploring: bool = False, first: int | None = None
    ) -> Plan:
        """Plan from where a history ends; see `Planner.plan`."""
        routes = self.towards(knowledge)
        plan = self.planner.plan(history, replace(knowledge, routes=routes), exploring=exploring, first=first)
        verdicts = self.judge.judge(plan.scenarios.states, history.states[0])
        sought = routes is not knowledge.routes
        far = routes.distances[plan.end_nodes] if sought else np.zeros(len(plan.scenarios))
        order = np.lexsort((far, verdicts.distances, -verdicts.progress, verdicts.reached, -verdicts.broken))
        return reordered(plan, order)

    def towards(self, knowledge: Knowledge) -> Routes:
        """Return the ways to nodes that meet the goal, planned anew when other ones do or the map has changed."""
        graph = knowledge.state_map.graph_
        goals = self.judge.nodes(graph) if len(graph) else None
        if goals is None:
            return knowledge.routes
        places = goals.tobytes()
        if self._routes is None or self._routes[0] is not graph or self._routes[1] != places:
            self._routes = graph, places, plan_routes(graph, self.costs, goals=goals)
        return self._routes[2]
