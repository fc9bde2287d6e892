"""What the lower line makes of play: episodes, the map, what might come, the plan."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semrl.core.named import NO_ACTION, Floats, Ints


@dataclass(frozen=True, kw_only=True, slots=True)
class Trajectory:
    """One episode as the lower line learns from it (§3.4.4)."""

    states: Floats
    """``(t + 1, d)`` float32, from the first state to the one after the last decision."""
    actions: Ints
    """``(t,)`` int64."""
    rewards: Floats
    """``(t,)`` float32."""
    things: tuple[Floats, ...] = ()
    """``t + 1`` tables, what was seen at each state, see `semrl.core.things`; empty where that is not known."""

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def transitions(self) -> "Transitions":
        """Every decision on its own; the state before the first one is that one."""
        return Transitions(
            states=self.states[:-1],
            previous=np.concatenate([self.states[:1], self.states[:-2]])[: len(self)],
            actions=self.actions,
            rewards=self.rewards,
            next_states=self.states[1:],
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Transitions:
    """Decisions, each on its own: what the models of §3.4.3 learn from."""

    states: Floats
    """``(t, d)`` float32, in which the decisions were taken."""
    previous: Floats
    """``(t, d)`` float32, the states before these."""
    actions: Ints
    """``(t,)`` int64."""
    rewards: Floats
    """``(t,)`` float32."""
    next_states: Floats
    """``(t, d)`` float32, what they led to."""

    def __len__(self) -> int:
        return len(self.actions)

    def take(self, places: Ints) -> "Transitions":
        """Return those at the given places, in that order."""
        return Transitions(**{name: getattr(self, name)[places] for name in self.__dataclass_fields__})


@dataclass(frozen=True, kw_only=True, slots=True)
class MapGraph:
    """The state map at one moment (§3.4.1): nodes are clusters of states, edges clusters of transitions.

    Several edges may join the same two nodes, and an edge may lead back to where it starts.
    """

    node_ids: Ints
    """``(n,)`` int64, ascending; an id stays with its node as the map grows."""
    node_means: NDArray[np.float64]
    """``(n, d)`` float64, centroids."""
    node_counts: Ints
    """``(n,)`` int64, states that each node stands for."""
    edge_ids: Ints
    """``(m,)`` int64, ascending; stable like those of nodes."""
    sources: Ints
    targets: Ints
    """``(m,)`` int64, positions of the nodes in the arrays above (not their ids)."""
    edge_counts: Ints
    """``(m,)`` int64, transitions that each edge stands for."""
    rewards: NDArray[np.float64]
    """``(m,)`` float64, mean reward."""
    actions: NDArray[np.float64]
    """``(m, n_actions)`` float64, share of each action among the transitions; rows sum to 1."""

    def __len__(self) -> int:
        return len(self.node_ids)

    @property
    def reward_signs(self) -> Ints:
        """Kind of each edge, ``(m,)`` of −1, 0, 1: the mean reward rounded to the nearest of them, halves outwards."""
        return (np.sign(self.rewards) * (np.abs(self.rewards) >= 0.5)).astype(np.int64)


@dataclass(frozen=True, kw_only=True, slots=True)
class History:
    """Where a plan begins: the present state and what led to it."""

    states: Floats
    """``(h, d)`` float32, the newest first; the first ones of an episode have fewer."""
    actions: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    """``(p,)`` int64, the newest first, likewise."""
    number: int = 0
    """Decisions of the episode so far."""
    proposed: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    """``(t,)`` int64, the actions that the plan before proposed from here on; empty where there was none."""
    things: tuple[Floats, ...] = ()
    """What was seen at each of the states, see `semrl.core.things`; empty where that is not known."""
    lists: tuple[Floats, ...] = ()
    """In place of the states, once for each of several things that share a place in them; see `State.lists`."""
    learning: bool = False
    """Whether the episode is learned from: then plans are made in less time."""

    def window(self, count: int) -> Floats:
        """Return the newest states, ``(count, d)``; before the first one known it is taken to have been the same."""
        return self.states[np.minimum(np.arange(count), len(self.states) - 1)]

    def recent(self, count: int) -> Floats:
        """Return the newest actions, ``(count,)`` float32; −1 before the first one known."""
        padded = np.full(count, NO_ACTION, np.float32)
        known = self.actions[:count]
        padded[: len(known)] = known
        return padded


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenarios:
    """What might come: sequences of actions rolled forward through the models (§3.4.3)."""

    actions: Ints
    """``(s, t)`` int64."""
    states: Floats
    """``(s, t, d)`` float32, the state that each action is predicted to lead to."""
    rewards: Floats
    """``(s, t)`` float32, the predicted sign of each action's reward; where several models are asked, their mean."""
    values: Floats
    """``(s,)`` float32, the discounted return that is expected beyond the last state; 0 where none is."""
    uncertainties: Floats | None = None
    """``(s,)`` float32, standard deviation of the discounted return among the models that were asked; None where there
    is only one."""

    def __len__(self) -> int:
        return len(self.actions)


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """What the planner proposes in one state, and why (§3.4.4)."""

    node: int
    """Position of the state's node in the map, or −1 where there is no map yet."""
    path: Ints
    """``(p,)`` int64, positions of nodes from this one to one with a positive edge; empty where none is known."""
    scenarios: Scenarios
    """All of them, the best first."""
    returns: NDArray[np.float64]
    """``(s,)`` float64, predicted return of each, less what the uncertainty about it counts."""
    end_nodes: Ints
    """``(s,)`` int64, position of the node each ends in, or −1 where there is no map yet."""
    progress: Ints
    """``(s,)`` int64, how far along the path that node lies, or −1 off the path."""
    seeks_novelty: bool = False
    """Whether no reward was ever met, so that scenarios with the same return were sorted by how far from all that is
    known they end."""

    @property
    def actions(self) -> Ints:
        """The actions of the best scenario, ``(t,)`` int64."""
        best: Ints = self.scenarios.actions[0]
        return best
