"""Training: perception first, then the agent; observers hang on it."""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np

from semrl.agents import Agent
from semrl.core import AgentObservation, Observation, State
from semrl.core.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.envs import Game, Played
from semrl.perception.encoders import Encoder
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stages import Stage
from semrl.planning.module import PlanningModule
from semrl.training.loop import EpisodeView, Frames, Step, play
from semrl.training.stored_play import pretrain, stored_from_arrays, stored_to_arrays, warm_start

Row = dict[str, Any]
"""One line of the metrics: column → value."""

AGENT = "agent"
"""Name of the phase in which the agent learns; the phases before it are the stages of perception."""


class Observer(Protocol):
    """Something that watches the training: progress, metrics, checkpoints, a person's wish to stop."""

    def on_decision(self, trainer: "Trainer") -> None:
        """Is called after every decision, when the whole state may be saved."""

    def on_row(self, row: Row) -> None:
        """Is called with everything that was measured: after each batch of a stage and each episode."""


class Trainer:
    """Plays, lets perception and then the agent learn, and can be saved between any two decisions.

    Parameters
    ----------
    game, encoder, schedule, agent, planning
        The parts; all learn in place. Models without a map have no planning module.
    decisions
        Budget, perception included.
    seed
        Of the random actions taken while perception learns.
    observers
        Called at every decision and row, in order.

    Attributes
    ----------
    decisions_ : int
        Decisions taken so far.
    returns_ : list of float
        Returns of the episodes that the agent finished.
    episodes_ : int
        Episodes since perception was ready, those that the planner played among them.
    """

    def __init__(
        self,
        game: Game,
        encoder: Encoder,
        schedule: PretrainingSchedule,
        agent: Agent,
        planning: PlanningModule | None = None,
        *,
        decisions: int,
        seed: int,
        observers: Sequence[Observer] = (),
    ) -> None:
        self.game = game
        self.encoder = encoder
        self.schedule = schedule
        self.agent = agent
        self.planning = planning
        self.decisions = decisions
        self.observers = list(observers)
        self.decisions_ = 0
        self.returns_: list[float] = []
        self.episodes_ = 0
        self._rng = np.random.default_rng(seed)
        self._step: Step | None = None  # where the episode stands
        self._view: EpisodeView | None = None  # what is made of it, once the agent plays
        self._stored: list[Played] = []  # what perception is to learn from
        self._advised: int | None = None  # what the planner would have done at the newest decision

    @property
    def perceiving(self) -> bool:
        """Whether perception is still being learned."""
        return self.schedule.current is not None

    @property
    def phase(self) -> str:
        """Name of what is being learned."""
        return self.schedule.current.name if self.schedule.current else AGENT

    def run(self) -> None:
        """Play until the budget is spent.

        Raises
        ------
        UsageError
            When perception finds nothing.
        """
        while self.decisions_ < self.decisions:
            for _ in self._perceive() if self.perceiving else self._act():
                for observer in self.observers:
                    observer.on_decision(self)
                if self.decisions_ >= self.decisions:
                    break
        if self.schedule.current:
            self.schedule.current.require_found()

    def to_arrays(self) -> Arrays:
        """Return the state of everything; `from_arrays` then goes on as if nothing had happened."""
        parts = {
            "game": self.game.to_arrays(),
            "encoder": self.encoder.to_arrays(),
            "schedule": self.schedule.to_arrays(),
            "agent": self.agent.to_arrays(),
        }
        if self.planning:
            parts["planning"] = self.planning.to_arrays()
        if self._step:
            parts["step"] = _step_to_arrays(self._step)
        if self._view:
            parts["view"] = {"exploring": np.array(self._view.exploring), **self._view.to_arrays()}
        if self._stored:
            parts["stored"] = stored_to_arrays(self._stored)
        return {
            **nest(**parts),
            "rng": rng_to_array(self._rng),
            "decisions": np.array(self.decisions_),
            "perceiving": np.array(self.perceiving),
            "returns": np.array(self.returns_),
            "episodes": np.array(self.episodes_),
        }

    def inference_arrays(self) -> Arrays:
        """Return what is needed to play: what perception, agent, map and world model have learned."""
        parts = {"encoder": self.encoder.to_arrays(), "agent": self.agent.inference_arrays()}
        if self.planning:
            parts["planning"] = self.planning.inference_arrays()
        return {**nest(**parts), "decisions": np.array(self.decisions_), "perceiving": np.array(self.perceiving)}

    def memory_arrays(self) -> Arrays:
        """Return what map and world model need to go on learning from further play."""
        return nest(planning=self.planning.to_arrays()) if self.planning else {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over a saved state."""
        self.encoder.from_arrays(unnest(arrays, "encoder"))
        self.schedule.from_arrays(unnest(arrays, "schedule"))
        self.agent.from_arrays(unnest(arrays, "agent"))
        observation = self.game.from_arrays(unnest(arrays, "game"))
        step, view = unnest(arrays, "step"), unnest(arrays, "view")
        self._step = _step_from_arrays(step, observation) if observation and step else None
        self._view = self._restored_view(view) if view else None
        if self.planning:  # after the view, which begins an episode
            self.planning.from_arrays(unnest(arrays, "planning"))
        self._stored = stored_from_arrays(unnest(arrays, "stored"))
        self._rng = array_to_rng(arrays["rng"])
        self.decisions_ = int(arrays["decisions"])
        self.returns_ = arrays["returns"].tolist()
        self.episodes_ = int(arrays["episodes"])

    def _perceive(self) -> Iterator[None]:
        """Play at random to the end of an episode, or of a stage with which another way of learning begins."""
        stage = self.schedule.current

        def learn_and_move(step: Step) -> int:
            nonlocal stage
            stage = self.schedule.learn(step.observation, step.action)
            return int(self._rng.integers(self.game.n_actions))

        for step in play(self.game, Frames(), learn_and_move, self._step):
            if not step.number:
                self._step = step
                continue
            assert stage is not None
            self.decisions_ += 1
            # The agent begins with an episode of its own.
            over = step.done or not self.perceiving or self.schedule.uses_stored_play
            self._step = None if over else step
            if over and self.schedule.stores_play:
                self._stored.append(self.game.played)
            self._report_stage(stage)
            if self.schedule.uses_stored_play:
                self._pretrain()
            yield
            if over:
                return

    def _pretrain(self) -> None:
        """Let perception learn from the play so far, then map and world model."""
        for stage in pretrain(self.game, self.schedule, self._stored):
            self._report_stage(stage)
        if self.planning:
            warm_start(self.game, self.encoder, self.planning, self._stored)
        self._stored = []

    def _act(self) -> Iterator[None]:
        """Play with the agent, or the planner, to the end of an episode; everything learns from it."""
        if self._view is None:
            # What map and world model were warmed up with stands for an episode of the agent's.
            number = self.episodes_ + self.schedule.stores_play
            planned = self.planning is not None and self.planning.planner_controls(number)
            self._view = EpisodeView(self.encoder, self.planning, exploring=planned, learning=True)
        view = self._view
        for step in play(self.game, view, self._choose, self._step):
            before, self._step = self._step, step
            if before is None:
                continue
            self.decisions_ += 1
            self._learn(before, step)
            if step.done:
                self._step = self._view = None
                self._finish(step, planned=view.exploring)
            yield

    def _choose(self, step: Step) -> int:
        assert step.shown is not None and self._view is not None
        self._advised = self.planning.proposed_action if self.planning else None
        return self.agent.act(step.shown, self._advised if self._view.exploring else None)

    def _learn(self, before: Step, after: Step) -> None:
        """Let the agent learn from one decision."""
        assert before.shown is not None and after.shown is not None and after.action is not None
        self.agent.observe(
            before.shown,
            after.action,
            after.training_reward,
            terminated=after.terminated,
            start=before.number == 0,
            advised=self._advised,
        )
        if after.done:
            self.agent.end_episode(after.shown)

    def _finish(self, last: Step, *, planned: bool) -> None:
        """Let map and world model learn from an episode that is over, and report it."""
        assert last.state is not None
        self.episodes_ += 1
        if not planned:
            self.returns_.append(last.total)
        learned = self.planning.end_episode(last.state.facts, last.state.things) if self.planning else {}
        self._report({
            "phase": AGENT,
            "episode": self.episodes_,
            "policy": "planner" if planned else "agent",
            "return": last.total,
            "length": last.number,
            **self.agent.measured(),
            **learned,
        })  # fmt: skip

    def _restored_view(self, arrays: Arrays) -> EpisodeView:
        view = EpisodeView(self.encoder, self.planning, exploring=bool(arrays["exploring"]), learning=True)
        view.from_arrays(arrays)
        return view

    def _report_stage(self, stage: Stage) -> None:
        self._report({"phase": stage.name, "batches": stage.batches_, **stage.measured()})

    def _report(self, row: Row) -> None:
        for observer in self.observers:
            observer.on_row({**row, "decisions": self.decisions_})


def _step_to_arrays(step: Step) -> Arrays:
    """Return everything but the observation, which the game keeps, and the plan, which is made anew."""
    arrays: Arrays = {"number": np.array(step.number), "total": np.array(step.total)}
    if step.action is not None:
        arrays["action"] = np.array(step.action)
    if step.state is not None and step.shown is not None:
        arrays |= {"vectors": step.shown.vectors, "plan": step.shown.plan, "facts": step.state.facts}
        arrays["things"] = step.state.things
    return arrays


def _step_from_arrays(arrays: Arrays, observation: Observation) -> Step:
    shown = state = None
    if "vectors" in arrays:
        shown = AgentObservation(vectors=arrays["vectors"], plan=arrays["plan"])
        state = State(vector=arrays["vectors"][0], facts=arrays["facts"], things=arrays["things"])
    return Step(
        observation=observation,
        number=int(arrays["number"]),
        action=int(arrays["action"]) if "action" in arrays else None,
        total=float(arrays["total"]),
        state=state,
        shown=shown,
    )
