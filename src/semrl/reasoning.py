"""Reasoning, the lower line of Fig. 1.1: from the agent's own play to a map, from the map to a plan and a goal.

states ─ map, next state, reward ─ routes, scenarios ─ plan ─ goal vector
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from semrl.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.errors import UsageError
from semrl.grounding import GoalConfig, goal_size, ground
from semrl.ontology import (
    EpisodeRecord,
    Experience,
    NextStateConfig,
    RewardConfig,
    StateMap,
    StateMapConfig,
    make_next_state_model,
    make_reward_model,
    with_past_actions,
)
from semrl.planner import (
    LongTermConfig,
    ShortTermConfig,
    action_sequences,
    imagine,
    plan_routes,
    rank,
)
from semrl.types import Floats, Ints, Plan, Scenarios, Trajectory, Transitions

MAP_MODELS = ("semantic-map", "ram-map")
"""The models of Table 4.1 that reason."""


@dataclass(frozen=True, kw_only=True)
class ReasoningConfig:
    """Parameters of every box of the lower line."""

    state_map: StateMapConfig = field(default_factory=StateMapConfig)
    """When two states are the same."""
    velocity_weight: float = 0.0
    """What the difference to the previous state counts on the map, against 1 for the state; 0: it is left out."""
    next_state: NextStateConfig = field(default_factory=NextStateConfig)
    """How the next state is predicted."""
    reward: RewardConfig = field(default_factory=RewardConfig)
    """How rewards are predicted."""
    past_actions: int = 0
    """Actions before the last state that both models are told as well: things that have inertia go on by them."""
    rehearsal_states: int = 0
    """States of past episodes that the models rehearse, rewards in equal shares; 0: they see each episode once."""
    rehearsal_reward_share: float = 0.0
    """Share of what the next-state model rehearses that lies shortly before a reward: what happens there is rare."""
    long_term: LongTermConfig = field(default_factory=LongTermConfig)
    """What paths cost."""
    short_term: ShortTermConfig = field(default_factory=ShortTermConfig)
    """Which scenarios are imagined."""
    discount: float = 1.0
    """What a predicted reward counts one decision later."""
    goal: GoalConfig = field(default_factory=GoalConfig)
    """What the agent is told of the plan."""

    def __post_init__(self) -> None:
        if not (min(self.rehearsal_states, self.past_actions) >= 0 and 0 <= self.velocity_weight < np.inf):
            raise UsageError("reasoning.rehearsal_states, past_actions and velocity_weight must be 0 or more")
        if not 0 <= self.rehearsal_reward_share <= 1:
            raise UsageError(f"reasoning.rehearsal_reward_share must lie in 0 … 1, not {self.rehearsal_reward_share}")
        if not 0 < self.discount <= 1:
            raise UsageError(f"reasoning.discount must lie above 0 and up to 1, not {self.discount}")


class Reasoner:
    """The boxes of the lower line, wired.

    Parameters
    ----------
    config
        Parameters of every box.
    dimension
        Length of a state vector.
    n_actions
        Number of actions.
    seed
        Of networks and rehearsal.

    Attributes
    ----------
    goal_size : int
        Length of the goal vector.
    """

    def __init__(self, config: ReasoningConfig, dimension: int, n_actions: int, *, seed: int) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        self.goal_size = goal_size(config.goal, dimension=dimension, depth=config.short_term.depth, n_actions=n_actions)
        self.sequences = action_sequences(n_actions, config.short_term)
        self.state_map = StateMap(config.state_map, dimension * (2 if config.velocity_weight else 1), n_actions)
        size = dimension + config.past_actions
        self.next_state = make_next_state_model(config.next_state, size, n_actions, seed=seed)
        self.reward = make_reward_model(config.reward, size, n_actions, seed=seed)
        self.experience = Experience(config.rehearsal_states, size)
        self.routes = plan_routes(self.state_map.graph_, config.long_term)
        self._episode = EpisodeRecord(dimension)
        self._rng = np.random.default_rng(seed)

    @property
    def past(self) -> Floats:
        """The actions observed last in this episode, the newest first, as `plan` wants them; −1 before the first."""
        return self._episode.recent_actions(self.config.past_actions + 1)

    def plan(self, state: Floats, past: Floats | None = None) -> Plan | None:
        """Plan from a state; None before anything was learned.

        Parameters
        ----------
        state
            ``(2, d)``, the current one and the one before.
        past
            What `past` was then; as it is now when None.
        """
        if not self.next_state.is_fitted:
            return None
        scenarios = self.imagine(state, self.past if past is None else past, self.sequences)
        before_last = scenarios.states[:, -2] if self.sequences.shape[1] > 1 else state[None, 0]
        return rank(
            scenarios,
            self._coordinates(state[:1], state[1:]),
            self._coordinates(scenarios.states[:, -1], before_last),
            self.state_map,
            self.routes,
            discount=self.config.discount,
        )

    def imagine(self, state: Floats, past: Floats, sequences: Ints) -> Scenarios:
        """Roll ``(s, t)`` sequences of actions forward from a state; see `plan`."""
        now, before = np.append(state[0], past[:-1]), np.append(state[1], past[1:])
        told = imagine(now, before, sequences, self.next_state, self.reward)
        return Scenarios(actions=told.actions, states=told.states[:, :, : self.dimension], rewards=told.rewards)

    def begin_episode(self) -> None:
        """Forget the actions of an episode that was not learned from."""
        self._episode.clear()

    def goal(self, state: Floats) -> Floats:
        """Return what the agent is told in a state, ``(goal_size,)`` float32; zeros before anything was learned."""
        plan = self.plan(state)
        if plan is None:
            return np.zeros(self.goal_size, np.float32)
        hold = self.config.short_term.hold_decisions
        return ground(plan, self.config.goal, hold_decisions=hold, n_actions=self.n_actions)

    def beside_goal(self, encoded: Floats, before: Floats | None) -> Floats:
        """Put the goal beside a state: what the agent sees (§3.4.4).

        Parameters
        ----------
        encoded
            ``(d,)``, the state.
        before
            The same of the previous decision, goal included; None at the start of an episode.
        """
        previous = encoded if before is None else before[: self.dimension]
        return np.concatenate([encoded, self.goal(np.stack([encoded, previous]))])

    def observe(self, seen: Floats, action: int, reward: float) -> None:
        """Note a decision: what the agent saw, did and got."""
        self._episode.add(seen[: self.dimension], action, reward)

    def end_episode(self, last: Floats) -> dict[str, float]:
        """Learn from the episode whose last observation this is; see `learn`."""
        return self.learn(self._episode.finish(last[: self.dimension]))

    def learn(self, trajectory: Trajectory) -> dict[str, float]:
        """Learn from an episode after its end (§3.4.4).

        Returns
        -------
        dict
            Columns of the metrics: size of the map, and seconds that each part took.
        """
        clock = _Clock()
        self.state_map.partial_fit(self.on_map(trajectory))
        clock.lap("seconds_map")
        self._learn_models(trajectory, clock)
        self.routes = plan_routes(self.state_map.graph_, self.config.long_term)
        clock.lap("seconds_routes")
        graph = self.state_map.graph_
        return {"map_nodes": len(graph), "map_edges": len(graph.edge_ids), **clock.laps}

    def on_map(self, trajectory: Trajectory) -> Trajectory:
        """Return an episode as the map learns it: its states where they lie on the map."""
        transitions = trajectory.transitions
        starts = self._coordinates(transitions.states, transitions.previous)
        last = self._coordinates(trajectory.states[-1:], trajectory.states[-2:-1])
        return replace(trajectory, states=np.concatenate([starts, last]))

    def told(self, trajectory: Trajectory) -> Trajectory:
        """Return an episode as the models learn it: its states with the actions before them."""
        return replace(
            trajectory, states=with_past_actions(trajectory.states, trajectory.actions, self.config.past_actions)
        )

    def to_arrays(self) -> Arrays:
        """Return all that was learned."""
        return {
            **nest(
                state_map=self.state_map.to_arrays(),
                next_state=self.next_state.to_arrays(),
                reward=self.reward.to_arrays(),
                experience=self.experience.to_arrays(),
                episode=self._episode.to_arrays(),
            ),
            "rng": rng_to_array(self._rng),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        self.load(arrays)
        self.experience.from_arrays(unnest(arrays, "experience"))
        self._episode.from_arrays(unnest(arrays, "episode"))
        self._rng = array_to_rng(arrays["rng"])

    def load(self, arrays: Arrays) -> None:
        """Take over map and models; enough to plan."""
        self.state_map.from_arrays(unnest(arrays, "state_map"))
        self.next_state.from_arrays(unnest(arrays, "next_state"))
        self.reward.from_arrays(unnest(arrays, "reward"))
        self.routes = plan_routes(self.state_map.graph_, self.config.long_term)

    def _learn_models(self, trajectory: Trajectory, clock: "_Clock") -> None:
        told = self.told(trajectory)
        if self.config.rehearsal_states:
            self.experience.add(told)
        for lesson in self._lessons(self.config.next_state, told.transitions):
            self.next_state.partial_fit(lesson)
        clock.lap("seconds_next_state")
        for lesson in self._lessons(self.config.reward, told.transitions, balanced=True):
            self.reward.partial_fit(lesson)
        clock.lap("seconds_reward")

    def _coordinates(self, states: Floats, previous: Floats) -> Floats:
        """Return where ``(b, d)`` states lie on the map."""
        weight = np.float32(self.config.velocity_weight)
        return np.concatenate([states, weight * (states - previous)], axis=1) if weight else states

    def _lessons(
        self, model: NextStateConfig | RewardConfig, episode: Transitions, *, balanced: bool = False
    ) -> Iterator[Transitions]:
        """Yield what a model learns from, pass by pass: the episode, or as much of what is remembered."""
        if model.kind == "trees":  # they remember by themselves
            yield episode
            return
        for _ in range(model.epochs):
            if not self.config.rehearsal_states:
                yield episode
            elif balanced:
                yield self.experience.draw_balanced(self._rng, len(episode))
            else:
                yield self.experience.draw(self._rng, len(episode), self.config.rehearsal_reward_share)


class _Clock:
    """Takes the time of one thing after the other."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._began = time.perf_counter()

    def lap(self, name: str) -> None:
        """Note how long it is since the last one."""
        now = time.perf_counter()
        self.laps[name] = round(now - self._began, 4)
        self._began = now
