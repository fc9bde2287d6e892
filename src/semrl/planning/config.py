"""Which boxes the lower line of Fig. 1.1 has, and their parameters."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semrl.concepts import ConceptsConfig
from semrl.core.errors import UsageError
from semrl.core.registry import Registry
from semrl.grounding import GROUNDERS, PlanFeaturesConfig
from semrl.planning.keeping import KeepingConfig
from semrl.planning.long_term import LongTermConfig
from semrl.planning.protocol import Planner
from semrl.planning.scenario_planner import ScenarioPlannerConfig
from semrl.planning.state_map import StateMapConfig
from semrl.world_model import WORLD_MODELS, LiftedConfig, ModelPairConfig, TreesConfig

PLANNERS: Registry[Planner] = Registry("planners", {"scenarios": "semrl.planning.scenario_planner:ScenarioPlanner"})

MEMORY_DECISIONS = 16
"""Past states and actions that a plan may look at."""


@dataclass(frozen=True, kw_only=True)
class PlanningConfig:
    """Which boxes the lower line has, and the parameters of each, under its name."""

    world_model: str = "networks"
    """What predicts: the thesis's networks for next state and reward, regression trees, for short states
    (trees), or trees about the concepts of things, where things are followed (lifted)."""
    planner: str = "scenarios"
    """What decides with the predictions."""
    grounder: str = "plan_features"
    """What writes the plan for the agent."""
    state_map: StateMapConfig = field(default_factory=StateMapConfig)
    """When two states are the same."""
    velocity_weight: float = 0.0
    """What the difference to the previous state counts on the map, against 1 for the state; 0: it is left out."""
    networks: ModelPairConfig = field(default_factory=ModelPairConfig)
    """The thesis's models."""
    trees: TreesConfig = field(default_factory=TreesConfig)
    """Regression trees."""
    lifted: LiftedConfig = field(default_factory=LiftedConfig)
    """Trees about concepts of things."""
    concepts: ConceptsConfig = field(default_factory=ConceptsConfig)
    """When kinds of things are one concept."""
    long_term: LongTermConfig = field(default_factory=LongTermConfig)
    """What paths cost."""
    scenarios: ScenarioPlannerConfig = field(default_factory=ScenarioPlannerConfig)
    """Which scenarios are imagined, and which is best."""
    keeping: KeepingConfig = field(default_factory=KeepingConfig)
    """How long a plan is kept while what it predicted comes."""
    plan_features: PlanFeaturesConfig = field(default_factory=PlanFeaturesConfig)
    """What the agent is shown of the plan."""
    discount: float = 1.0
    """What a predicted reward counts one decision later."""
    planner_every: int = 0
    """Of the training episodes so many in a row, one is played by the planner, from which all parts learn; 0: none."""
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Parameters of boxes that other packages add: name of the box → parameter → value."""

    def __post_init__(self) -> None:
        WORLD_MODELS.check(self.world_model)
        PLANNERS.check(self.planner)
        GROUNDERS.check(self.grounder)
        for name in ("planner_every", "velocity_weight"):
            if not 0 <= getattr(self, name) < np.inf:
                raise UsageError(f"planning.{name} must be 0 or more, not {getattr(self, name)}")
        if max(self.trees.past_states, self.trees.past_actions) > MEMORY_DECISIONS:
            raise UsageError(f"trees.past_states and past_actions may be {MEMORY_DECISIONS} at most")
        if not 0 < self.discount <= 1:
            raise UsageError(f"planning.discount must lie above 0 and up to 1, not {self.discount}")
