"""All parts of a run, made and wired from its configuration."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from semrl.agents import AGENTS, Agent
from semrl.core import StateSpace
from semrl.core.arrays import Arrays, unnest
from semrl.core.errors import UsageError
from semrl.envs import Game, make_env
from semrl.envs.actions import Env
from semrl.perception.encoders import ENCODERS, Encoder
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.planning.module import PlanningModule
from semrl.training.config import RunConfig
from semrl.training.crowd import is_counted, needed_slots, with_room
from semrl.training.trainer import Observer, Trainer
from semrl.training.world import World


def build_trainer(
    config: RunConfig, observers: Sequence[Observer] = (), *, env: Env | None = None, world: World | None = None
) -> Trainer:
    """Make all parts of a run and wire them; its environment, and what is noted of it, may be there already."""
    env = env or make_env(config.env, config.environment)
    parts = build_parts(config, world or look_at(env, config))
    seeds = _seeds(config)
    return Trainer(
        Game(env, seeds[0]),
        parts.encoder,
        PretrainingSchedule(parts.encoder.stages(config.stability), config.stability),
        parts.agent,
        parts.planning,
        decisions=config.decisions,
        seed=seeds[2],
        observers=observers,
    )


def look_at(env: Env, config: RunConfig, looking: Callable[[], None] | None = None) -> World:
    """Return what is to be noted of a run's environment; `looking` is called first where that takes seconds."""
    seeds, world = _seeds(config), World.of(env, config.environment)
    if is_counted(config):
        build_parts(config, world)  # what cannot work is refused at once
        if looking:
            looking()
    return replace(world, slots=needed_slots(config, env, game_seed=seeds[0], seed=seeds[2]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Parts:
    """All parts of a run that learn; they can be made without the environment."""

    encoder: Encoder
    agent: Agent
    planning: PlanningModule | None

    def load_inference(self, arrays: Arrays) -> None:
        """Take over what is needed to play; with more of the planning module than that, it can go on learning."""
        self.encoder.from_arrays(unnest(arrays, "encoder"))
        self.agent.from_arrays(unnest(arrays, "agent"))
        if self.planning:
            self.planning.from_arrays(unnest(arrays, "planning"))


def build_parts(config: RunConfig, world: World) -> Parts:
    """Make the parts of a run that learn."""
    seeds, n_actions = _seeds(config), len(world.actions)
    perception = with_room(config.perception, world.slots) if world.slots else config.perception
    encoder = ENCODERS.load(config.encoder_name)(perception, rom=world.rom, planning=config.plans)
    space = encoder.space
    planning = make_planning(config, space, n_actions, seed=seeds[3]) if config.plans else None
    agent = AGENTS.make(
        config.agent,
        config,
        space=space,
        plan_size=planning.plan_size if planning else 0,
        n_actions=n_actions,
        seed=seeds[1],
        budget=config.decisions,
        device=config.device,
    )
    return Parts(encoder=encoder, agent=agent, planning=planning)


def make_planning(config: RunConfig, space: StateSpace, n_actions: int, *, seed: int) -> PlanningModule:
    """Make the planning module for what an encoder shows.

    Raises
    ------
    UsageError
        When that holds no facts, or no things where the world model needs them.
    """
    if not space.n_facts:
        raise UsageError(f"a planner needs facts to reason about, and the encoder '{config.encoder_name}' has none")
    planning = PlanningModule(config.planning, space.n_facts, n_actions, seed=seed, axes=space.axes, seen=space.seen)
    if getattr(planning.world_model, "reads_things", False) and not space.has_things:
        raise UsageError(
            f"the world model '{config.planning.world_model}' needs things that are followed, which the encoder "
            f"'{config.encoder_name}' does not; use --model objects-map"
        )
    return planning


def _seeds(config: RunConfig) -> list[int]:
    """Return the seeds of game, agent, trainer and planning module."""
    return [int(seed) for seed in np.random.SeedSequence(config.seed).generate_state(4)]
