"""A trained agent that plays, with the perception and the map it was trained with, without learning."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from semrl.agents import DQN
from semrl.core import Observation
from semrl.core.arrays import unnest
from semrl.core.errors import SemrlError, UsageError
from semrl.envs import Game, make_env, played_actions
from semrl.perception.pipeline import Pipeline
from semrl.planning.module import MAP_MODELS, Reasoner, Thought
from semrl.training.config import RunConfig
from semrl.training.folder import PLAYABLE, RunFolder
from semrl.training.session import build_trainer

Policy = Literal["agent", "planner"]
"""Who decides: the agent, or the planner's best scenario alone (§4.3)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Step:
    """What is seen after a decision, and the return so far.

    Attributes
    ----------
    observation, total
        As it says.
    state
        ``(2, *shape)``, what the agent sees now and saw before.
    action
        The one that led here; None at the beginning.
    thought
        Where the planner stands and what it proposes; None where there is no planner.
    """

    observation: Observation
    total: float
    state: NDArray[Any]
    action: int | None
    thought: Thought | None = None


@dataclass(frozen=True, kw_only=True)
class Player:
    """A trained agent with the perception it was trained with."""

    config: RunConfig
    pipeline: Pipeline
    agent: DQN
    reasoner: Reasoner | None
    decisions: int
    perceiving: bool
    """Whether perception was still being learned at this checkpoint."""

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions that it plays with, by number."""
        return played_actions(self.new_game(0).env, self.config.environment.actions)

    def under(self, **conditions: Any) -> Self:
        """Return the same player, tested under other conditions: fields of `EvaluationConfig`."""
        tested = replace(self.config.evaluation, **conditions)
        return replace(self, config=replace(self.config, evaluation=tested))

    def new_game(self, seed: int) -> Game:
        """Make the game that it was trained on, begun and played as evaluation wants it."""
        tested, environment = self.config.evaluation, self.config.environment
        sticky = tested.sticky_actions or environment.sticky_actions
        environment = replace(environment, max_noops=tested.max_noops, sticky_actions=sticky)
        return Game(make_env(self.config.env, environment), seed)

    def episode(self, number: int, seed: int, policy: Policy = "agent") -> Iterator[Step]:
        """Play one of the episodes of an evaluation: the same one for the same number and seed."""
        rng = np.random.default_rng([seed, number])
        return self.play(self.new_game(int(rng.integers(2**31))), rng, policy)

    def play(self, game: Game, rng: np.random.Generator, policy: Policy = "agent") -> Iterator[Step]:
        """Play one episode and yield every decision of it, beginning with the first observation."""
        observation = game.reset()
        self.pipeline.begin_episode()
        if self.reasoner:
            self.reasoner.begin_episode()
        seen, thought = self.see(observation)
        state = np.stack([seen, seen])
        yield Step(observation=observation, total=0.0, state=state, action=None, thought=thought)
        total, done = 0.0, False
        while not done:
            explore = rng.random() < self.config.evaluation.exploration
            action = int(rng.integers(game.n_actions)) if explore else self.choose(state, policy)
            outcome = game.step(action)
            if self.reasoner:
                self.reasoner.observe(state[0], action, outcome.reward)
            seen, thought = self.see(outcome.observation)
            state = np.stack([seen, state[0]])
            total += outcome.reward
            done = outcome.done
            yield Step(observation=outcome.observation, total=total, state=state, action=action, thought=thought)

    def see(self, observation: Observation) -> tuple[NDArray[Any], Thought | None]:
        """Return what the agent is shown, the state and, where there is a map, the goal; and the plan behind it."""
        encoded = self.pipeline.encode(observation)
        return self.reasoner.think(encoded) if self.reasoner else (encoded, None)

    def choose(self, state: NDArray[Any], policy: Policy) -> int:
        """Return the action that the agent or the planner would take."""
        if policy == "agent":
            return self.agent.best_action(state)
        assert self.reasoner is not None, "only models with a map are asked for plans"
        return self.reasoner.proposed_action or 0

    def require_map(self, run: str | Path) -> Reasoner:
        """Return the reasoner.

        Raises
        ------
        UsageError
            When the model has no map, or the first episode is not over yet; the message names the run.
        """
        if self.reasoner is None:
            models = " or ".join(f"--model {model}" for model in MAP_MODELS)
            raise UsageError(f"{run} is of model '{self.config.model}', which has no map; train one with {models}")
        if not len(self.reasoner.state_map.graph_):
            raise UsageError(f"the map of {run} is still empty: it is drawn after the agent's first episode")
        return self.reasoner

    def require_foresight(self, run: str | Path) -> Reasoner:
        """Return the reasoner.

        Raises
        ------
        UsageError
            When there is no map, or its models of the world have not learned enough to foresee; the message names the
            run.
        """
        reasoner = self.require_map(run)
        if not reasoner.world.is_fitted:
            raise UsageError(f"{run} cannot foresee anything yet, so there are no plans: it needs more decisions")
        return reasoner


def load_pipeline(run: str | Path) -> Pipeline:
    """Return the trained perception of a run.

    Raises
    ------
    UsageError
        When there is no run, or it has not learned anything yet.
    """
    return load_player(run).pipeline


def load_player(run: str | Path, at: int | None = None, *, memory: bool = False) -> Player:
    """Return the agent and the perception of a run, as of its newest checkpoint or of a milestone.

    With `memory` its map and models can go on learning: what they remember is loaded as well.
    """
    folder = RunFolder.open(Path(run))
    config = folder.config()
    checkpoint = folder.load(prefixes=(*PLAYABLE, *(("reasoner/",) if memory else ())), at=at)
    if checkpoint is None:
        raise UsageError(f"{run} has no checkpoint yet; go on with: semrl train --run {run} --resume")
    trainer = build_trainer(replace(config, agent=replace(config.agent, replay_capacity=config.agent.n_steps + 1)))
    try:
        trainer.pipeline.from_arrays(unnest(checkpoint.arrays, "pipeline"))
        trainer.agent.load_network(unnest(checkpoint.arrays, "agent/network"))
        if trainer.reasoner:
            learned = unnest(checkpoint.arrays, "reasoner")
            (trainer.reasoner.from_arrays if memory else trainer.reasoner.load)(learned)
    except (KeyError, ValueError, TypeError, RuntimeError) as error:
        raise SemrlError(f"the checkpoint of {run} does not fit its configuration ({error})") from error
    position = checkpoint.arrays.get("schooling/position")
    return Player(
        config=config,
        pipeline=trainer.pipeline,
        agent=trainer.agent,
        reasoner=trainer.reasoner,
        decisions=int(checkpoint.arrays["decisions"]),
        perceiving=position is not None and int(position) < len(trainer.schooling.stages),
    )
