"""The one environment loop: perception first, then the agent; observers hang on it."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semrl.agents import DQN
from semrl.core import Observation
from semrl.core.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.envs import Game, Played
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stages import Stage
from semrl.planning.module import Reasoner
from semrl.training.episode import Episode
from semrl.training.stored_play import played_from_arrays, played_to_arrays, recall, study

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
    game, pipeline, schooling, agent, reasoner
        The parts; all learn in place. Models without a map have no reasoner.
    decisions
        Budget, perception included.
    seed
        Of the random actions taken while perception learns.
    observers
        Are told of every decision and row, in order.

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
        pipeline: Pipeline,
        schooling: Schooling,
        agent: DQN,
        reasoner: Reasoner | None = None,
        *,
        decisions: int,
        seed: int,
        observers: Sequence[Observer] = (),
    ) -> None:
        self.game = game
        self.pipeline = pipeline
        self.schooling = schooling
        self.agent = agent
        self.reasoner = reasoner
        self.decisions = decisions
        self.observers = list(observers)
        self.decisions_ = 0
        self.returns_: list[float] = []
        self.episodes_ = 0
        self._rng = np.random.default_rng(seed)
        self._episode: Episode | None = None
        self._played: list[Played] = []  # what perception is to study

    @property
    def perceiving(self) -> bool:
        """Whether perception is still being learned."""
        return self.schooling.current is not None

    @property
    def phase(self) -> str:
        """Name of what is being learned."""
        return self.schooling.current.name if self.schooling.current else AGENT

    def run(self) -> None:
        """Play until the budget is spent."""
        while self.decisions_ < self.decisions:
            if self._episode is None:
                self._episode = self._begin()
            if self.perceiving:
                self._perceive(self._episode)
            else:
                self._act(self._episode)
            for observer in self.observers:
                observer.on_decision(self)

    def to_arrays(self) -> Arrays:
        """Return the state of everything; `from_arrays` then goes on as if nothing had happened."""
        parts = {
            "game": self.game.to_arrays(),
            "pipeline": self.pipeline.to_arrays(),
            "schooling": self.schooling.to_arrays(),
            "agent": self.agent.to_arrays(),
        }
        if self.reasoner is not None:
            parts["reasoner"] = self.reasoner.to_arrays()
        if self._episode is not None:
            parts["episode"] = self._episode.to_arrays()
        if self._played:
            parts["played"] = played_to_arrays(self._played)
        return {
            **nest(**parts),
            "rng": rng_to_array(self._rng),
            "decisions": np.array(self.decisions_),
            "returns": np.array(self.returns_),
            "episodes": np.array(self.episodes_),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over a saved state."""
        self.pipeline.from_arrays(unnest(arrays, "pipeline"))
        self.schooling.from_arrays(unnest(arrays, "schooling"))
        self.agent.from_arrays(unnest(arrays, "agent"))
        if self.reasoner is not None:
            self.reasoner.from_arrays(unnest(arrays, "reasoner"))
        observation = self.game.from_arrays(unnest(arrays, "game"))
        episode = unnest(arrays, "episode")
        self._episode = Episode.from_arrays(observation, episode) if observation and episode else None
        self._played = played_from_arrays(unnest(arrays, "played"))
        self._rng = array_to_rng(arrays["rng"])
        self.decisions_ = int(arrays["decisions"])
        self.returns_ = arrays["returns"].tolist()
        self.episodes_ = int(arrays["episodes"])

    def _begin(self) -> Episode:
        observation = self.game.reset()
        self.pipeline.begin_episode()
        # What was recalled stands for an episode of the agent's.
        planned = self.reasoner is not None and self.reasoner.leads(self.episodes_ + self.schooling.remembers)
        seen = None if self.perceiving else self._see(observation, curious=planned)
        return Episode(observation, None if seen is None else np.stack([seen, seen]), planned=planned)

    def _see(self, observation: Observation, *, curious: bool, learn: bool = False) -> NDArray[Any]:
        """Return what the agent is shown: the state and, where there is a map, the goal; learn from a reward first."""
        encoded = self.pipeline.encode(observation)
        if self.reasoner is None:
            return encoded
        if learn:
            self.reasoner.revise(encoded)
        return self.reasoner.think(encoded, curious=curious)[0]

    def _perceive(self, episode: Episode) -> None:
        """Show perception one frame and act at random."""
        stage = self.schooling.learn(episode.observation, episode.action)
        episode.action = int(self._rng.integers(self.game.n_actions))
        outcome = self.game.step(episode.action)
        self.decisions_ += 1
        episode.observation = outcome.observation
        if outcome.done or not self.perceiving or self.schooling.studies:
            self._episode = None  # the agent begins with an episode of its own
            if self.schooling.remembers:
                self._played.append(self.game.played)
        self._tell_of(stage)
        if self.schooling.studies:
            self._rehearse()

    def _rehearse(self) -> None:
        """Let perception study the play so far, then map and models recall it."""
        for stage in study(self.game, self.pipeline, self.schooling, self._played):
            self._tell_of(stage)
        if self.reasoner:
            recall(self.game, self.pipeline, self.reasoner, self._played)
        self._played = []

    def _act(self, episode: Episode) -> None:
        """Let the agent take one decision and learn from what it led to."""
        assert episode.state is not None
        advised = self.reasoner.proposed_action if self.reasoner else None
        action = self.agent.act(episode.state, advised if episode.planned else None)
        outcome = self.game.step(action)
        self.decisions_ += 1
        self.agent.observe(
            episode.state[0],
            action,
            outcome.reward,
            terminated=outcome.terminated,
            start=episode.length == 0,
            advised=advised,
        )
        if self.reasoner:
            self.reasoner.observe(episode.state[0], action, outcome.reward)
        seen = self._see(outcome.observation, curious=episode.planned, learn=outcome.reward != 0)
        episode.advance(outcome.observation, seen, outcome.reward)
        if outcome.done:
            self.agent.end_episode(seen)
            self._finish(episode, seen)

    def _finish(self, episode: Episode, last: NDArray[Any]) -> None:
        self._episode = None
        self.episodes_ += 1
        if not episode.planned:
            self.returns_.append(episode.total)
        learned = self.reasoner.end_episode(last) if self.reasoner else {}
        self._tell({
            "phase": AGENT,
            "episode": self.episodes_,
            "policy": "planner" if episode.planned else "agent",
            "return": episode.total,
            "length": episode.length,
            "exploration": self.agent.exploration,
            "loss": self.agent.loss_,
            "updates": self.agent.updates_,
            **learned,
        })  # fmt: skip

    def _tell_of(self, stage: Stage) -> None:
        self._tell({"phase": stage.name, "batches": stage.batches_, **stage.measured()})

    def _tell(self, row: Row) -> None:
        for observer in self.observers:
            observer.on_row({**row, "decisions": self.decisions_})
