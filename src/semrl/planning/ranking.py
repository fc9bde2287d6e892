"""Final reasoning (§3.4.4): which scenario is best."""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, MapGraph, Plan, Scenarios
from semrl.planning.long_term import Routes

OFF_PATH = -1


class Locator(Protocol):
    """A map that knows the node of a state."""

    @property
    def graph_(self) -> MapGraph:
        """The map."""
        ...

    def locate(self, states: Floats) -> Ints:
        """Return the positions of the nodes of ``(b, m)`` states, ``(b,)``."""
        ...


def rank(
    scenarios: Scenarios,
    start: Floats,
    ends: Floats,
    state_map: Locator,
    routes: Routes,
    *,
    discount: float = 1.0,
    uncertainty_penalty: float = 0.0,
) -> Plan:
    """Sort scenarios by return, then progress along the path, then closeness to the node reached (§3.4.4).

    The return is what is predicted, and what is expected beyond, less what its uncertainty counts. While no reward was
    ever met, the scenario that ends farthest from all that is known comes first, in place of the closest (D81).

    Parameters
    ----------
    scenarios
        As imagined, ``s`` of them.
    start, ends
        ``(1, m)`` and ``(s, m)``, where they begin and end on the map.
    state_map, routes
        The map and its long-term plan.
    discount
        What a reward counts one decision later.
    uncertainty_penalty
        What uncertainties count.

    Returns
    -------
    Plan
        With the best scenario first; of equal ones the first stays first. A scenario that ends off the path is
        measured by its distance to the path's end. On an empty map only the reward counts.
    """
    graph = state_map.graph_
    returns = returns_of(scenarios, discount=discount, uncertainty_penalty=uncertainty_penalty)
    node, path, end_nodes, progress, gaps = _places(start, ends, state_map, routes)
    novelty = len(graph) > 0 and not graph.rewards.any()
    order = np.lexsort((-gaps if novelty else gaps, -progress, -returns))
    return Plan(
        node=node,
        path=path,
        scenarios=take(scenarios, order),
        returns=returns[order],
        end_nodes=end_nodes[order],
        progress=progress[order],
        seeks_novelty=novelty,
    )


def returns_of(scenarios: Scenarios, *, discount: float, uncertainty_penalty: float) -> NDArray[np.float64]:
    """Return what each scenario is predicted to bring, and beyond, less what its uncertainty counts, ``(s,)``."""
    weights = discount ** np.arange(scenarios.rewards.shape[1], dtype=np.float64)  # (t,)
    returns = (scenarios.rewards * weights).sum(axis=1)  # a matrix product would round equal rows differently
    returns += discount ** len(weights) * scenarios.values
    if scenarios.uncertainties is not None:
        returns -= uncertainty_penalty * scenarios.uncertainties
    return np.asarray(returns, np.float64)


def continued(plan: Plan, start: Floats, state_map: Locator, routes: Routes, *, discount: float = 1.0) -> Plan:
    """Return what is left of a plan after its first decision, in the state that it predicted.

    Of the scenarios those stay that begin as the best one does, in their order. Returns begin one decision later.

    Parameters
    ----------
    plan
        Of two decisions or more.
    start
        ``(1, m)``, where the state reached lies on the map.
    state_map, routes, discount
        As for `rank`.
    """
    same = np.flatnonzero(plan.scenarios.actions[:, 0] == plan.actions[0])
    left = take(plan.scenarios, same)
    node, path = -1, plan.path
    if len(state_map.graph_):
        node = int(state_map.locate(start)[0])
        path = routes.path(node)
    return Plan(
        node=node,
        path=path,
        scenarios=replace(left, actions=left.actions[:, 1:], states=left.states[:, 1:], rewards=left.rewards[:, 1:]),
        returns=(plan.returns[same] - left.rewards[:, 0]) / discount,
        end_nodes=plan.end_nodes[same],
        progress=_progress(path, plan.end_nodes[same]),
        seeks_novelty=plan.seeks_novelty,
    )


def _places(
    start: Floats, ends: Floats, state_map: Locator, routes: Routes
) -> tuple[int, Ints, Ints, Ints, NDArray[np.float64]]:
    """Return the node of the start, the path from it, and of each end its node, progress and distance to what counts.

    On an empty map there are none: −1, and 0 for the distance.
    """
    graph = state_map.graph_
    if not len(graph):
        nowhere = np.full(len(ends), -1)
        return -1, np.zeros(0, np.int64), nowhere, nowhere, np.zeros(len(ends))
    nodes = state_map.locate(np.concatenate([start, ends]))
    node, end_nodes = int(nodes[0]), nodes[1:]
    path = routes.path(node)
    progress = _progress(path, end_nodes)
    reached = np.where(progress == OFF_PATH, path[-1] if len(path) else end_nodes, end_nodes)
    gaps = np.linalg.norm(ends - graph.node_means[reached], axis=1)  # (s,)
    return node, path, end_nodes, progress, gaps


def _progress(path: Ints, nodes: Ints) -> Ints:
    """Return how far along the path each node lies, or −1."""
    matches = nodes[:, None] == path[None, :]  # (s, p)
    if not matches.size:
        return np.full(len(nodes), OFF_PATH)
    return np.where(matches.any(axis=1), matches.argmax(axis=1), OFF_PATH)


def take(scenarios: Scenarios, order: Ints) -> Scenarios:
    """Return the same scenarios in another order."""
    return Scenarios(
        actions=scenarios.actions[order],
        states=scenarios.states[order],
        rewards=scenarios.rewards[order],
        values=scenarios.values[order],
        uncertainties=None if scenarios.uncertainties is None else scenarios.uncertainties[order],
    )


def joined(scenarios: Scenarios, more: Scenarios) -> Scenarios:
    """Return both, one behind the other, as one model imagined them."""
    uncertainties = None
    if scenarios.uncertainties is not None and more.uncertainties is not None:
        uncertainties = np.concatenate([scenarios.uncertainties, more.uncertainties])
    return Scenarios(
        actions=np.concatenate([scenarios.actions, more.actions]),
        states=np.concatenate([scenarios.states, more.states]),
        rewards=np.concatenate([scenarios.rewards, more.rewards]),
        values=np.concatenate([scenarios.values, more.values]),
        uncertainties=uncertainties,
    )


def reordered(plan: Plan, order: Ints) -> Plan:
    """Return the same plan with its scenarios in another order, the best first."""
    return replace(
        plan,
        scenarios=take(plan.scenarios, order),
        returns=plan.returns[order],
        end_nodes=plan.end_nodes[order],
        progress=plan.progress[order],
    )
