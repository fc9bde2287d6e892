"""The thesis's planner (§3.4.3, §3.4.4): imagine scenarios, rank them against the way on the map."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from semrl.core import History, Ints, Plan, Scenarios
from semrl.core.errors import UsageError
from semrl.planning.protocol import Knowledge
from semrl.planning.ranking import joined, rank, returns_of
from semrl.planning.short_term import ShortTermConfig, action_sequences, refined_sequences
from semrl.world_model.protocol import ConceptBased, Screening, WorldModel


@dataclass(frozen=True, kw_only=True, slots=True)
class ScenarioPlannerConfig(ShortTermConfig):
    """Which scenarios are imagined, and what their uncertainty counts."""

    uncertainty_penalty: float = 0.0
    """What the uncertainty of a scenario's return, the standard deviation of an ensemble, counts against it."""
    exploration_bonus: float = 0.0
    """How much less it counts in training episodes that the planner plays; above the penalty it is sought."""

    def __post_init__(self) -> None:
        ShortTermConfig.__post_init__(self)
        for name in ("uncertainty_penalty", "exploration_bonus"):
            if not 0 <= getattr(self, name) < np.inf:
                raise UsageError(f"scenarios.{name} must be 0 or more, not {getattr(self, name)}")


class ScenarioPlanner:
    """Chooses the best of many imagined sequences of actions.

    Parameters
    ----------
    config
        See `ScenarioPlannerConfig`.
    n_actions
        Number of actions.
    discount
        What a reward counts one decision later.

    Raises
    ------
    UsageError
        When all sequences are asked for and they are too many.
    """

    def __init__(self, config: ScenarioPlannerConfig, *, n_actions: int, discount: float = 1.0) -> None:
        self.config = config
        self.n_actions = n_actions
        self.discount = discount
        action_sequences(n_actions, config)  # too many are refused at once

    @property
    def depth(self) -> int:
        """Actions of a plan."""
        return self.config.depth

    def plan(
        self, history: History, knowledge: Knowledge, *, exploring: bool = False, first: int | None = None
    ) -> Plan:
        """Imagine, and rank what is imagined; see `Planner.plan`."""
        penalty = self.config.uncertainty_penalty - (self.config.exploration_bonus if exploring else 0.0)
        scenarios = self._imagined(history, knowledge.world_model, first, penalty)
        state, previous = history.window(2)
        before_last = scenarios.states[:, -2] if self.depth > 1 else state[None]
        return rank(
            scenarios,
            knowledge.coordinates(state[None], previous[None]),
            knowledge.coordinates(scenarios.states[:, -1], before_last),
            knowledge.state_map,
            knowledge.routes,
            discount=self.discount,
            uncertainty_penalty=penalty,
        )

    def _imagined(self, history: History, world_model: WorldModel, first: int | None, penalty: float) -> Scenarios:
        """Imagine what is drawn and then, where it is played and not learned, what the best of it are refined to."""
        config, number = self.config, history.number
        sequences = action_sequences(self.n_actions, config, number=number, proposed=history.proposed)
        scenarios = imagined(world_model, history, _beginning(sequences, first))
        if not config.refined or history.learning:
            return scenarios
        returns = returns_of(scenarios, discount=self.discount, uncertainty_penalty=penalty)
        best = scenarios.actions[np.argsort(-returns, kind="stable")[: config.elites]]
        sequences = refined_sequences(best, self.n_actions, config, number=number)
        return joined(scenarios, imagined(world_model, history, _beginning(sequences, first)))


def _beginning(sequences: Ints, first: int | None) -> Ints:
    """Let sequences begin with an action, if one is given."""
    if first is None:
        return sequences
    return np.column_stack([np.full(len(sequences), first), sequences[:, 1:]])


def imagined(world_model: WorldModel, history: History, sequences: Ints) -> Scenarios:
    """Imagine sequences of actions, ``(s, t)``; where things share a place in the state, with each of them in it.

    What comes of each of them comes of the actions: their rewards, values and uncertainties are added. States are those
    of the things that have the places now. World models that reason about things know all of them anyway.
    """
    if not history.lists or isinstance(world_model, ConceptBased):
        return world_model.imagine(history, sequences)
    alone = [replace(history, states=states, lists=()) for states in history.lists]
    if len(alone) == 1:
        return world_model.imagine(alone[0], sequences)
    with _unscreened(world_model):  # else each would leave out others
        main, *others = (world_model.imagine(one, sequences) for one in alone)
    for other in others:
        uncertainties = main.uncertainties
        if uncertainties is not None and other.uncertainties is not None:
            uncertainties = uncertainties + other.uncertainties
        rewards, values = main.rewards + other.rewards, main.values + other.values
        main = replace(main, rewards=rewards, values=values, uncertainties=uncertainties)
    return main


@contextlib.contextmanager
def _unscreened(world_model: WorldModel) -> Iterator[None]:
    """Let a world model imagine all scenarios."""
    if not isinstance(world_model, Screening):
        yield
        return
    before, world_model.screens = world_model.screens, False
    try:
        yield
    finally:
        world_model.screens = before
