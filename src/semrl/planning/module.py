"""Reasoning, the lower line of Fig. 1.1: from the agent's own play to a map, from the map to a plan and a goal.

states ─ map, next state, reward ─ routes, scenarios ─ plan ─ goal vector
"""

import time
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from semrl.core import Floats, Ints, Moment, Plan, Trajectory
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.grounding import GoalConfig, goal_size, ground
from semrl.planning import LongTermConfig, ShortTermConfig, action_sequences, plan_routes, rank
from semrl.planning.state_map import StateMap, StateMapConfig
from semrl.world_model import EpisodeRecord, ModelPair, ModelPairConfig, TreesConfig, TreeWorld
from semrl.world_model.protocol import WorldModel

MAP_MODELS = ("semantic-map", "ram-map", "objects-map")
"""The models that reason: two of Table 4.1, and one on tracked objects."""

MEMORY_DECISIONS = 16
"""Past states and actions that a plan may look at."""


@dataclass(frozen=True, kw_only=True)
class ReasoningConfig:
    """Parameters of every box of the lower line."""

    state_map: StateMapConfig = field(default_factory=StateMapConfig)
    """When two states are the same."""
    velocity_weight: float = 0.0
    """What the difference to the previous state counts on the map, against 1 for the state; 0: it is left out."""
    world: Literal["models", "trees"] = "models"
    """What foresees: the thesis's next-state and reward models, or regression trees, for short states."""
    models: ModelPairConfig = field(default_factory=ModelPairConfig)
    """The thesis's models."""
    trees: TreesConfig = field(default_factory=TreesConfig)
    """Regression trees."""
    long_term: LongTermConfig = field(default_factory=LongTermConfig)
    """What paths cost."""
    short_term: ShortTermConfig = field(default_factory=ShortTermConfig)
    """Which scenarios are imagined."""
    discount: float = 1.0
    """What a predicted reward counts one decision later."""
    caution: float = 0.0
    """What the doubt about a scenario's return, the forests' standard deviation, counts against it."""
    curiosity: float = 0.0
    """How much less it counts in training episodes that the planner plays; above `caution` it seeks what is doubted."""
    planner_every: int = 0
    """Of the training episodes so many in a row, one is played by the planner, from which all parts learn; 0: none."""
    goal: GoalConfig = field(default_factory=GoalConfig)
    """What the agent is told of the plan."""

    def __post_init__(self) -> None:
        for name in ("planner_every", "velocity_weight", "caution", "curiosity"):
            if not 0 <= getattr(self, name) < np.inf:
                raise UsageError(f"reasoning.{name} must be 0 or more, not {getattr(self, name)}")
        if max(self.trees.past_states, self.trees.past_actions) > MEMORY_DECISIONS:
            raise UsageError(f"trees.past_states and past_actions may be {MEMORY_DECISIONS} at most")
        if not 0 < self.discount <= 1:
            raise UsageError(f"reasoning.discount must lie above 0 and up to 1, not {self.discount}")


@dataclass(frozen=True, kw_only=True, slots=True)
class Thought:
    """What the planner makes of a moment; no plan before anything was learned."""

    moment: Moment
    plan: Plan | None


class Reasoner:
    """The boxes of the lower line, wired.

    Parameters
    ----------
    config
        Parameters of every box.
    dimension
        Length of a state that is reasoned about.
    n_actions
        Number of actions.
    seed
        Of networks and rehearsal.
    first
        Where it begins in what perception encodes; it is the end of it.
    axes
        ``(dimension,)`` int64: along which axis each number lies, −1: along none; all along one when None.

    Attributes
    ----------
    facts : slice
        Where it lies in what perception encodes, and in what the agent sees.
    goal_size : int
        Length of the goal vector.
    """

    def __init__(
        self,
        config: ReasoningConfig,
        dimension: int,
        n_actions: int,
        *,
        seed: int,
        first: int = 0,
        axes: Ints | None = None,
    ) -> None:
        self.config = config
        self.dimension = dimension
        self.facts = slice(first, first + dimension)
        self.n_actions = n_actions
        self.goal_size = goal_size(config.goal, dimension=dimension, depth=config.short_term.depth, n_actions=n_actions)
        action_sequences(n_actions, config.short_term)  # too many are refused at once
        changes = config.velocity_weight > 0
        self.state_map = StateMap(config.state_map, dimension * (2 if changes else 1), n_actions, changes=changes)
        self.axes = axes
        self.world = _make_world(config, dimension, n_actions, seed, axes)
        self.routes = plan_routes(self.state_map.graph_, config.long_term)
        self._episode = EpisodeRecord(dimension)
        self._proposed = np.zeros(0, np.int64)

    @property
    def proposed_action(self) -> int | None:
        """What the newest plan of this episode would do now; None where there is none."""
        return int(self._proposed[0]) if len(self._proposed) else None

    def plan(self, moment: Moment, *, curious: bool = False, first: int | None = None) -> Plan | None:
        """Plan from a moment, to learn or to win, perhaps with a given first action; None while nothing is learned."""
        if not self.world.is_fitted:
            return None
        sequences = action_sequences(
            self.n_actions, self.config.short_term, number=moment.number, proposed=moment.proposed
        )
        if first is not None:
            sequences = np.column_stack([np.full(len(sequences), first), sequences[:, 1:]])
        scenarios = self.world.imagine(moment, sequences)
        state, previous = moment.window(2)
        before_last = scenarios.states[:, -2] if sequences.shape[1] > 1 else state[None]
        return rank(
            scenarios,
            self._coordinates(state[None], previous[None]),
            self._coordinates(scenarios.states[:, -1], before_last),
            self.state_map,
            self.routes,
            discount=self.config.discount,
            caution=self.config.caution - (self.config.curiosity if curious else 0.0),
        )

    def leads(self, episode: int) -> bool:
        """Tell whether the planner plays the episode of this number, from 0."""
        every = self.config.planner_every
        return every > 0 and episode % every == every - 1

    def begin_episode(self) -> None:
        """Forget the actions of an episode that was not learned from."""
        self._episode.clear()
        self._proposed = np.zeros(0, np.int64)

    def goal(self, plan: Plan | None) -> Floats:
        """Return what the agent is told of a plan, ``(goal_size,)`` float32; zeros where there is none."""
        if plan is None:
            return np.zeros(self.goal_size, np.float32)
        return ground(plan, self.config.goal, n_actions=self.n_actions)

    def think(self, encoded: Floats, *, curious: bool = False) -> tuple[Floats, Thought]:
        """Plan from what was encoded, to learn or to win; put the goal behind it: what the agent sees (§3.4.4)."""
        moment = self._episode.moment(encoded[self.facts], MEMORY_DECISIONS, self._proposed[1:])
        plan = self.plan(moment, curious=curious)
        self._proposed = np.zeros(0, np.int64) if plan is None else plan.actions.copy()
        return np.concatenate([encoded, self.goal(plan)]), Thought(moment=moment, plan=plan)

    def observe(self, seen: Floats, action: int, reward: float) -> None:
        """Note a decision: what the agent saw, did and got."""
        self._episode.add(seen[self.facts], action, reward)

    def revise(self, encoded: Floats) -> None:
        """Let the model of the world learn from the episode up to what was encoded now."""
        self.world.revise(self._episode.so_far(encoded[self.facts]))

    def end_episode(self, last: Floats) -> dict[str, float]:
        """Learn from the episode at whose end the agent saw this; see `learn`."""
        trajectory = self._episode.so_far(last[self.facts])
        self.begin_episode()
        return self.learn(trajectory)

    def learn(self, trajectory: Trajectory) -> dict[str, float]:
        """Learn from an episode after its end (§3.4.4).

        Returns
        -------
        dict
            Columns of the metrics: size of the map, and seconds that each part took.
        """
        began = time.perf_counter()
        self.state_map.partial_fit(self.on_map(trajectory))
        mapped = time.perf_counter()
        learned = self.world.partial_fit(trajectory)
        modelled = time.perf_counter()
        self.routes = plan_routes(self.state_map.graph_, self.config.long_term)
        graph = self.state_map.graph_
        return {
            "map_nodes": len(graph),
            "map_edges": len(graph.edge_ids),
            "seconds_map": round(mapped - began, 4),
            **learned,
            "seconds_routes": round(time.perf_counter() - modelled, 4),
        }

    def on_map(self, trajectory: Trajectory) -> Trajectory:
        """Return an episode as the map learns it: its states where they lie on the map."""
        transitions = trajectory.transitions
        starts = self._coordinates(transitions.states, transitions.previous)
        last = self._coordinates(trajectory.states[-1:], trajectory.states[-2:-1])
        return replace(trajectory, states=np.concatenate([starts, last]))

    def to_arrays(self) -> Arrays:
        """Return all that was learned."""
        parts = nest(
            state_map=self.state_map.to_arrays(), world=self.world.to_arrays(), episode=self._episode.to_arrays()
        )
        return parts | {"proposed": self._proposed}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.state_map.from_arrays(unnest(arrays, "state_map"))
        self.world.from_arrays(unnest(arrays, "world"))
        self._episode.from_arrays(unnest(arrays, "episode"))
        self._proposed = arrays["proposed"]
        self.routes = plan_routes(self.state_map.graph_, self.config.long_term)

    def load(self, arrays: Arrays) -> None:
        """Take over map and models; enough to plan."""
        self.state_map.from_arrays(unnest(arrays, "state_map"))
        self.world.load(unnest(arrays, "world"))
        self.routes = plan_routes(self.state_map.graph_, self.config.long_term)

    def _coordinates(self, states: Floats, previous: Floats) -> Floats:
        """Return where ``(b, d)`` states lie on the map."""
        weight = np.float32(self.config.velocity_weight)
        return np.concatenate([states, weight * (states - previous)], axis=1) if weight else states


def _make_world(config: ReasoningConfig, dimension: int, n_actions: int, seed: int, axes: Ints | None) -> WorldModel:
    if config.world == "trees":
        return TreeWorld(config.trees, dimension, discount=config.discount, seed=seed, axes=axes)
    return ModelPair(config.models, dimension, n_actions, seed=seed)
