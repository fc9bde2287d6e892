"""The planning module, the lower line of Fig. 1.1: from play to a map, from the map to a plan and what is shown of it.

facts ─ map, world model ─ routes, scenarios ─ plan ─ plan features
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from semrl.concepts import Concepts, SceneBuilder
from semrl.core import Floats, History, Ints, Plan, Scene, Trajectory
from semrl.core.arrays import Arrays, nest, unnest
from semrl.grounding import GROUNDERS
from semrl.planning.config import MEMORY_DECISIONS, PLANNERS, PlanningConfig
from semrl.planning.extent import Extent
from semrl.planning.judged import JudgedPlanner
from semrl.planning.keeping import PlanKeeper
from semrl.planning.long_term import plan_routes
from semrl.planning.protocol import Knowledge, coordinates
from semrl.planning.state_map import StateMap
from semrl.world_model import WORLD_MODELS, ConceptRules, EpisodeRecord
from semrl.world_model.protocol import ConceptBased, Screening


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanRecord:
    """A plan and what it was made from."""

    history: History
    """The state in which it was made, and what led there."""
    plan: Plan | None
    """None before anything was learned."""
    features: Floats
    """``(plan_size,)`` float32, what the agent is shown of it; zeros where there is no plan."""


class PlanningModule:
    """The boxes of the lower line, wired, and the episode that is going on.

    Parameters
    ----------
    config
        Which boxes, and the parameters of each.
    dimension
        Length of the facts.
    n_actions
        Number of actions.
    seed
        Of the world model.
    axes
        ``(dimension,)`` int64: along which axis each fact lies, −1: along none; all along one when None.
    seen
        ``(dimension,)`` int64: which fact says whether the thing that each is about is seen; all always are when None.

    Attributes
    ----------
    world_model, planner, grounder, state_map, routes
        The boxes, and the ways on the map as they are planned now.
    extent
        Between which bounds the facts lay.
    concepts
        What the things of the world are, learned from each episode where things are followed.
    concept_rules
        What turns things, brings rewards and follows actions, read from the newest play for people.
    """

    def __init__(
        self,
        config: PlanningConfig,
        dimension: int,
        n_actions: int,
        *,
        seed: int,
        axes: Ints | None = None,
        seen: Ints | None = None,
    ) -> None:
        self.config = config
        self.dimension = dimension
        self.n_actions = n_actions
        self.axes = axes
        self.planner = PLANNERS.make(config.planner, config, n_actions=n_actions, discount=config.discount)
        self.grounder = GROUNDERS.make(
            config.grounder, config, dimension=dimension, depth=self.planner.depth, n_actions=n_actions
        )
        self.world_model = WORLD_MODELS.make(
            config.world_model,
            config,
            dimension=dimension,
            n_actions=n_actions,
            seed=seed,
            discount=config.discount,
            axes=axes,
        )
        changes = config.velocity_weight > 0
        self.state_map = StateMap(config.state_map, dimension * (2 if changes else 1), n_actions, changes=changes)
        self.routes = plan_routes(self.state_map.graph_, config.long_term)
        self.extent = Extent(dimension, seen)
        self.concepts = Concepts(config.concepts)
        if isinstance(self.world_model, ConceptBased):
            self.world_model.share(self.concepts)
        self.concept_rules = ConceptRules(self.concepts)
        self._episode = EpisodeRecord(dimension)
        self._learning = False
        self._proposed = np.zeros(0, np.int64)
        self._keeper = PlanKeeper(config.keeping, discount=config.discount)

    @property
    def plan_size(self) -> int:
        """How many numbers the agent is shown of a plan."""
        return self.grounder.size

    @property
    def proposed_action(self) -> int | None:
        """What the newest plan of this episode would do now; None where there is none."""
        return int(self._proposed[0]) if len(self._proposed) else None

    @property
    def knowledge(self) -> Knowledge:
        """What plans are made with now."""
        return Knowledge(
            world_model=self.world_model,
            state_map=self.state_map,
            routes=self.routes,
            velocity_weight=self.config.velocity_weight,
        )

    def scene(self, history: History) -> Scene:
        """Return what is seen where a history ends, each thing of its concept; empty before any is known."""
        return SceneBuilder(self.concepts).scene(history.things)

    def plan(self, history: History, *, exploring: bool = False, first: int | None = None) -> Plan | None:
        """Plan from where a history ends, perhaps with a given first action; None while nothing is learned."""
        if not self.world_model.is_fitted:
            return None
        return self.planner.plan(history, self.knowledge, exploring=exploring, first=first)

    def screen(self, on: bool) -> None:
        """Say whether the world model may leave out scenarios that promise little reward, where it can."""
        if isinstance(self.world_model, Screening):
            self.world_model.screens = on

    def planner_controls(self, episode: int) -> bool:
        """Tell whether the planner plays the training episode of this number, from 0."""
        every = self.config.planner_every
        return every > 0 and episode % every == every - 1

    def begin_episode(self, *, learning: bool = False) -> None:
        """Forget the actions of an episode that was not learned from, and say whether the next one is."""
        self._learning = learning
        self._episode.clear()
        self._proposed = np.zeros(0, np.int64)
        self._keeper.renew(None)

    def plan_step(
        self,
        facts: Floats,
        things: Floats | None = None,
        *,
        lists: tuple[Floats, ...] = (),
        exploring: bool = False,
    ) -> PlanRecord:
        """Plan at the next decision of the episode (§3.4.4), or go on with a plan that holds.

        Facts, things and lists are those of its `State`.
        """
        history = self._episode.history(facts, MEMORY_DECISIONS, self._proposed[1:], things)
        history = replace(history, lists=lists, learning=self._learning)
        plan = None
        if not isinstance(self.planner, JudgedPlanner):
            plan = self._keeper.what_is_left(history, self._episode.last_reward, self.knowledge)
        if plan is None:
            plan = self.plan(history, exploring=exploring)
            self._keeper.renew(plan)
        return self._noted(history, plan)

    def plan_again(self, record: PlanRecord) -> PlanRecord:
        """Plan anew at the decision for which a plan was just made: something else is wanted or known since."""
        plan = self.plan(record.history)
        self._keeper.renew(plan)
        return self._noted(record.history, plan)

    def _noted(self, history: History, plan: Plan | None) -> PlanRecord:
        if plan is None:
            self._proposed = np.zeros(0, np.int64)
            return PlanRecord(history=history, plan=None, features=np.zeros(self.plan_size, np.float32))
        self._proposed = plan.actions.copy()
        return PlanRecord(history=history, plan=plan, features=self.grounder.ground(plan))

    def observe(self, facts: Floats, action: int, reward: float, things: Floats | None = None) -> None:
        """Note a decision: the state, what was done in it, and the reward."""
        self._episode.add(facts, action, reward, things)

    def update_online(self, facts: Floats, things: Floats | None = None) -> None:
        """Let the world model learn from the episode up to the state that was reached now."""
        self.world_model.update_online(self._episode.so_far(facts, things))

    def end_episode(self, facts: Floats, things: Floats | None = None) -> dict[str, float]:
        """Learn from the episode that ended in this state; see `learn`."""
        trajectory = self._episode.so_far(facts, things)
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
        if any(len(seen) for seen in trajectory.things):
            self.concepts.partial_fit(trajectory.things)
        self.concept_rules.partial_fit(trajectory)
        self.state_map.partial_fit(self.on_map(trajectory))
        self.extent.partial_fit(trajectory.states)
        mapped = time.perf_counter()
        learned = self.world_model.partial_fit(trajectory)
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
        weight, transitions = self.config.velocity_weight, trajectory.transitions
        starts = coordinates(transitions.states, transitions.previous, weight)
        last = coordinates(trajectory.states[-1:], trajectory.states[-2:-1], weight)
        return replace(trajectory, states=np.concatenate([starts, last]))

    def to_arrays(self) -> Arrays:
        """Return all that was learned, and the episode."""
        parts = nest(
            state_map=self.state_map.to_arrays(),
            world_model=self.world_model.to_arrays(),
            episode=self._episode.to_arrays(),
            concepts=self.concepts.to_arrays(),
            extent=self.extent.to_arrays(),
            concept_rules=self.concept_rules.to_arrays(),
        )
        return parts | nest(kept=self._keeper.to_arrays()) | {"proposed": self._proposed}

    def inference_arrays(self) -> Arrays:
        """Return map and world model as far as plans need them."""
        return nest(
            state_map=self.state_map.to_arrays(),
            world_model=self.world_model.inference_arrays(),
            concepts=self.concepts.to_arrays(),
            extent=self.extent.to_arrays(),
            concept_rules=self.concept_rules.to_arrays(),
        )

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called; of the part for inference, plan as it did there."""
        if concepts := unnest(arrays, "concepts"):  # older checkpoints have none
            self.concepts.from_arrays(concepts)
        if rules := unnest(arrays, "concept_rules"):
            self.concept_rules.from_arrays(rules)
        self.state_map.from_arrays(unnest(arrays, "state_map"))
        if extent := unnest(arrays, "extent"):
            self.extent.from_arrays(extent)
        else:  # older checkpoints have none
            self.extent.partial_fit(self.state_map.graph_.node_means[:, : self.dimension])
        self.world_model.from_arrays(unnest(arrays, "world_model"))
        self.routes = plan_routes(self.state_map.graph_, self.config.long_term)
        if "proposed" in arrays:
            self._episode.from_arrays(unnest(arrays, "episode"))
            self._proposed = arrays["proposed"]
            self._keeper.from_arrays(unnest(arrays, "kept"))
