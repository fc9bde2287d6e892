"""A trained agent that plays, with the perception and the map it was trained with, without learning."""

import contextlib
import itertools
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from semrl.agents import Agent
from semrl.agents.devices import is_there
from semrl.core.errors import SemrlError, UsageError
from semrl.envs import Game, make_env
from semrl.envs.actions import Env
from semrl.evaluation.graph import empty_map, no_map
from semrl.perception.encoders import Encoder
from semrl.planning.class_planner import ClassPlanner
from semrl.planning.module import PlanningModule
from semrl.training.config import RunConfig
from semrl.training.folder import RunFolder
from semrl.training.loop import EpisodeView, Step, play
from semrl.training.parts import build_parts
from semrl.training.world import World, read_world

Policy = Literal["agent", "planner"]
"""Who decides: the agent, or the planner's best scenario alone (§4.3)."""


@dataclass(frozen=True, kw_only=True)
class Player:
    """A trained agent with the perception it was trained with."""

    config: RunConfig
    encoder: Encoder
    agent: Agent
    planning: PlanningModule | None
    decisions: int
    world: World
    """What the run has noted of its environment."""
    perceiving: bool
    """Whether perception was still being learned at this checkpoint."""
    shield: Callable[[int, Step], int] | None = None
    """Exchanges what the agent would do where people have forbidden what it leads to; see `shielded`."""
    classes: ClassPlanner | None = None
    """Plans by classes of scenes, where they count; see `counting_classes`."""

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions that it plays with, by number."""
        return self.world.actions

    def under(self, **conditions: Any) -> Self:
        """Return the same player, tested under other conditions: fields of `EvaluationConfig`."""
        tested = replace(self.config.evaluation, **conditions)
        return replace(self, config=replace(self.config, evaluation=tested))

    @property
    def variant(self) -> str:
        """How the game is altered that it plays."""
        tested = self.config.evaluation.variant
        return self.config.environment.variant if tested is None else tested

    def new_env(self, *, every_frame: bool = False) -> Env:
        """Make the environment that it was trained on, begun and played as evaluation wants it; close it after use.

        With `every_frame`, `newest_frames` returns what was shown between two decisions.
        """
        tested, environment = self.config.evaluation, self.config.environment
        sticky = environment.sticky_actions if tested.sticky_actions is None else tested.sticky_actions
        played = replace(
            self.world.shown_alike(environment),
            max_noops=tested.max_noops,
            sticky_actions=sticky,
            variant=self.variant,
        )
        return make_env(self.config.env, played, every_frame=every_frame)

    def new_game(self, seed: int) -> Game:
        """Make a game of its own in such an environment."""
        return Game(self.new_env(), seed)

    def episode(
        self, number: int, seed: int, policy: Policy = "agent", env: Env | None = None
    ) -> Generator[Step, None, None]:
        """Play one of the episodes of an evaluation: the same one for the same number and seed.

        Without `env`, one of `new_env`, the episode has an environment of its own, which is closed at its end.
        """
        with contextlib.nullcontext(env) if env else contextlib.closing(self.new_env()) as world:
            game, rng = evaluation_game(world, number, seed)
            yield from self.play(game, rng, policy)

    def play(self, game: Game, rng: np.random.Generator, policy: Policy = "agent") -> Iterator[Step]:
        """Play one episode and yield every step of it, beginning with the first observation.

        It ends with the game or, in a game that does not end, after `EvaluationConfig.max_decisions`; the last step
        then is not ``done``.
        """
        return self.play_by(game, self.view(), lambda step: self.decide(step, game.n_actions, rng, policy))

    def play_by(self, game: Game, view: EpisodeView, choose: Callable[[Step], int]) -> Iterator[Step]:
        """Play one episode as `play` does, as somebody else decides."""
        steps = play(game, view, choose)
        return itertools.islice(steps, self.config.evaluation.max_decisions + 1)  # and the first observation

    def view(self, *, plans: bool = True) -> EpisodeView:
        """Begin an episode that is seen and, where plans are wanted, planned in, without learning."""
        return EpisodeView(self.encoder, self.planning, plans=plans)

    def decide(self, step: Step, n_actions: int, rng: np.random.Generator, policy: Policy) -> int:
        """Return what is done in an evaluation: what the agent or the planner would do or, by chance, anything."""
        explore = rng.random() < self.config.evaluation.exploration
        return int(rng.integers(n_actions)) if explore else self.choose(step, policy)

    def choose(self, step: Step, policy: Policy) -> int:
        """Return the action that the agent or the planner would take."""
        assert step.shown is not None
        if policy == "agent":
            action = self.agent.best_action(step.shown)
            return self.shield(action, step) if self.shield else action
        assert self.planning is not None, "only models with a map are asked for plans"
        return self.planning.proposed_action or 0

    def require_map(self, run: str | Path) -> PlanningModule:
        """Return the planning module.

        Raises
        ------
        UsageError
            When the model has no map, or the first episode is not over yet; the message names the run.
        """
        if self.planning is None:
            raise UsageError(no_map(run, self.config.model))
        if not len(self.planning.state_map.graph_):
            raise UsageError(empty_map(run))
        return self.planning

    def require_predictions(self, run: str | Path) -> PlanningModule:
        """Return the planning module.

        Raises
        ------
        UsageError
            When there is no map, or its world model has not learned enough to predict; the message names the run.
        """
        planning = self.require_map(run)
        if not planning.world_model.is_fitted:
            raise UsageError(f"{run} cannot predict anything yet, so there are no plans: it needs more decisions")
        return planning


def evaluation_game(env: Env, number: int, seed: int) -> tuple[Game, np.random.Generator]:
    """Return the game of an episode of an evaluation, and the generator of what chance decides in it."""
    rng = np.random.default_rng([seed, number])
    return Game(env, int(rng.integers(2**31))), rng


def load_encoder(run: str | Path) -> Encoder:
    """Return the trained perception of a run.

    Raises
    ------
    UsageError
        When there is no run, or it has not learned anything yet.

    Examples
    --------
    With the run of the page *Start*:

    >>> load_encoder("runs/catch").space.names[:2]
    ('object 0 x', 'object 0 y')
    """
    return load_player(run).encoder


def load_player(run: str | Path, at: int | None = None, *, memory: bool = False) -> Player:
    """Return the agent and the perception of a run, as of its newest checkpoint or of a milestone.

    With `memory` its map and world model can go on learning: what they remember is loaded as well.
    """
    folder = RunFolder.open(Path(run))
    config = folder.config()
    checkpoint = folder.newest(at, play_only=True, memory=memory)
    device = config.device if is_there(config.device) else "auto"  # what a GPU has learned plays without one as well
    dqn = replace(config.dqn, replay_capacity=config.dqn.n_steps + 1)
    world = read_world(folder.manifest(), run)
    parts = build_parts(replace(config, device=device, dqn=dqn), world)
    try:
        parts.load_inference(checkpoint.arrays)
    except (KeyError, ValueError, TypeError, RuntimeError) as error:
        raise SemrlError(f"the checkpoint of {run} does not fit its configuration ({error})") from error
    return Player(
        config=config,
        encoder=parts.encoder,
        agent=parts.agent,
        planning=parts.planning,
        decisions=int(checkpoint.arrays["decisions"]),
        world=world,
        perceiving=bool(checkpoint.arrays["perceiving"]),
    )
