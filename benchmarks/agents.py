"""How long an agent takes to choose an action and to learn, for both kinds of network in each preset.

What comes before it, from the emulator to the state, is timed by ``semrl bench``. Here states are made up: neither
time depends on what is in them. Stages take turns; a time is the median of the rounds, of one thread on one core.

    python benchmarks/agents.py [--rounds N] [--json]
"""

import itertools
import json
from dataclasses import dataclass, replace
from typing import Any

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.agents import DQN
from semrl.core import IMAGE_SIZE_PX, AgentObservation, StateSpace
from semrl.perception.config import PerceptionConfig
from semrl.training import PRESETS, preset
from semrl.training.session import limited_threads
from semrl_thesis.timing import Stage, medians

STATES, UPDATES = 300, 5
"""Actions and updates in one pass."""

REPLAY = 500
"""Observations in the replay buffer."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Time the agents of both presets."""

    rounds: int = 7
    """Passes of every stage; the median counts."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Measure, tell."""
    with limited_threads(1):
        times = medians(agent_stages(), arguments.rounds)
        kind = machine.describe()
    if arguments.json:
        rows = [{"name": name, "microseconds": seconds * 1e6} for name, seconds in times.items()]
        print(json.dumps({"machine": kind, **vars(arguments), "stages": rows}))
        return
    table = Table("stage", "µs", "per second", box=None, padding=(0, 2, 0, 0))
    for column in table.columns[1:]:
        column.justify = "right"
    for name, seconds in times.items():
        table.add_row(name, f"{seconds * 1e6:,.1f}", f"{1 / seconds:,.0f}")
    console = Console()
    console.print(table)
    console.print(machine.sentence(kind), highlight=False)


def agent_stages() -> list[Stage]:
    """List choosing an action and learning."""
    stages = []
    rng = np.random.default_rng(0)
    images = list(rng.integers(0, 256, (STATES, IMAGE_SIZE_PX, IMAGE_SIZE_PX)).astype(np.uint8))
    vectors = list(rng.standard_normal((STATES, PerceptionConfig().hashed.dimension), dtype=np.float32))
    kinds: tuple[tuple[str, str, list[Any]], ...] = (("vector", "semantic", vectors), ("image", "baseline", images))
    for name, (kind, model, seen) in itertools.product(PRESETS, kinds):
        # One update at every decision, as soon as the buffer is filled: `observe` then times exactly one.
        config = replace(preset(name, model).dqn, learning_starts=REPLAY, replay_capacity=2 * REPLAY)
        config = replace(config, train_freq=1)
        space = StateSpace(shape=seen[0].shape, dtype=seen[0].dtype)
        agent = DQN(config, space=space, n_actions=2, seed=0)
        for i in range(REPLAY):
            remember(agent, seen[i % len(seen)])
        title = f"{kind} network, {name}"
        stages.append(Stage(f"act, {title}", agent.best_action, [shown(one) for one in seen]))
        learn = lambda one, agent=agent: remember(agent, one)  # noqa: E731
        stages.append(Stage(f"update of {config.batch_size}, {title}", learn, seen[:UPDATES]))
    return stages


def shown(vector: Any) -> AgentObservation:
    """Show a state that was there before as well."""
    return AgentObservation(vectors=np.stack([vector, vector]))


def remember(agent: DQN, observation: Any) -> None:
    """Show an agent one decision; it learns when its buffer is filled."""
    agent.observe(shown(observation), 0, 0.0, terminated=False, start=False)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
