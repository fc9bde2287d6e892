"""The one environment loop: training, evaluation, explanations, videos and pretraining all walk it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from semrl.core import AgentObservation, Observation, Outcome, Sight, State
from semrl.core.arrays import Arrays, nest, unnest
from semrl.envs import Game
from semrl.perception.encoders import Encoder, EpisodeEncoder
from semrl.planning.module import PlanningModule, PlanRecord


@dataclass(frozen=True, kw_only=True, slots=True)
class Step:
    """Where an episode stands after a decision, or at its beginning."""

    observation: Observation
    """What the environment shows."""
    number: int = 0
    """Decisions so far."""
    action: int | None = None
    """The one that led here; None at the beginning."""
    reward: float = 0.0
    total: float = 0.0
    """What it brought, and the return so far."""
    training_reward: float = 0.0
    """What is learned from in place of the reward; see `Outcome`."""
    terminated: bool = False
    truncated: bool = False
    """Whether the episode is over, and how."""
    state: State | None = None
    """The state behind it, likewise."""
    shown: AgentObservation | None = None
    """What an agent is shown here; None while perception learns."""
    record: PlanRecord | None = None
    """The plan that was made here; None where there is no planner."""

    @property
    def done(self) -> bool:
        """Whether the episode is over."""
        return self.terminated or self.truncated


class View(Protocol):
    """What is made of the observations of one episode."""

    def begin(self, observation: Observation) -> Step:
        """Return the first step of an episode."""
        ...

    def follow(self, before: Step, action: int, outcome: Outcome) -> Step:
        """Return the step after another one."""
        ...


def play(game: Game, view: View, choose: Callable[[Step], int], start: Step | None = None) -> Iterator[Step]:
    """Play one episode: yield its beginning, then what every decision led to.

    Parameters
    ----------
    game
        Is played.
    view
        Makes steps of what is seen.
    choose
        Decides at each step that does not end the episode.
    start
        Where the episode goes on, when it was begun before; that step is not yielded again.
    """
    step = start
    if step is None:
        step = view.begin(game.reset())
        yield step
    while not step.done:
        action = choose(step)
        step = view.follow(step, action, game.step(action))
        yield step


class Frames:
    """The view of whoever looks at frames alone, while perception learns."""

    def begin(self, observation: Observation) -> Step:
        """Return the first step of an episode."""
        return Step(observation=observation)

    def follow(self, before: Step, action: int, outcome: Outcome) -> Step:
        """Return the step after another one."""
        return next_step(before, action, outcome)


class EpisodeView:
    """Encodes every observation of one episode and, where there is a planner, plans at it.

    Parameters
    ----------
    encoder
        Makes the states.
    planning
        Makes the plans; None for models without a map. Its episode is this one.
    exploring
        Whether plans are to learn by.
    learning
        Whether the episode is learned from: the world model may learn from a reward at once, and plans take less time.
    plans
        Whether there is a plan at every decision; else the planning module only takes note of what happens.
    """

    def __init__(
        self,
        encoder: Encoder,
        planning: PlanningModule | None = None,
        *,
        exploring: bool = False,
        learning: bool = False,
        plans: bool = True,
    ) -> None:
        self.planning = planning
        self.exploring = exploring
        self.learning = learning
        self.plans = plans
        self._episode: EpisodeEncoder = encoder.begin()
        if planning:
            planning.begin_episode(learning=learning)

    def begin(self, observation: Observation) -> Step:
        """Return the first step of the episode."""
        return self._step(Step(observation=observation), None)

    def follow(self, before: Step, action: int, outcome: Outcome) -> Step:
        """Return the step after another one."""
        assert before.state is not None
        if self.planning:
            self.planning.observe(before.state.facts, action, outcome.training_reward, before.state.things)
        return self._step(next_step(before, action, outcome), before.state)

    def look(self) -> Sight:
        """Return what was seen in the newest observation."""
        return self._episode.look()

    def to_arrays(self) -> Arrays:
        """Return what the encoder remembers of the episode; the planning module saves its own part."""
        return nest(encoder=self._episode.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the episode was saved."""
        self._episode.from_arrays(unnest(arrays, "encoder"))

    def _step(self, bare: Step, before: State | None) -> Step:
        state = self._episode.encode(bare.observation)
        vectors = np.stack([state.vector, state.vector if before is None else before.vector])
        record = self._plan(state, bare.training_reward)
        shown = AgentObservation(vectors=vectors, **({"plan": record.features} if record else {}))
        return replace(bare, state=state, shown=shown, record=record)

    def _plan(self, state: State, reward: float) -> PlanRecord | None:
        if self.planning is None:
            return None
        if self.learning and reward:
            self.planning.update_online(state.facts, state.things)
        if not self.plans:
            return None
        return self.planning.plan_step(state.facts, state.things, lists=state.lists, exploring=self.exploring)


def next_step(before: Step, action: int, outcome: Outcome) -> Step:
    """Return what one decision led to, as far as the environment says."""
    return Step(
        observation=outcome.observation,
        number=before.number + 1,
        action=action,
        reward=outcome.reward,
        total=before.total + outcome.reward,
        training_reward=outcome.training_reward,
        terminated=outcome.terminated,
        truncated=outcome.truncated,
    )
