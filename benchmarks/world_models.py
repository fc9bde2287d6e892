"""World Models (§2.6.1) on Catch or Pong: what C reaches in real games, beside random play, and what each step takes.

The budget counts decisions of real play, all of them random; V and M learn from these, C in M's dream. Each step's
result is kept in the folder, so a call that was stopped goes on with the step it was at. Games of the test begin with
up to 30 no-ops on Pong, as those of the frontier do.

    python benchmarks/world_models.py --world catch|pong [--decisions N] [--seed S] [--episodes E] [--out DIR] [--json]
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.core.errors import SemrlError, UsageError
from semrl.envs import EnvironmentConfig
from semrl_thesis.world_models import (
    ControllerConfig,
    DreamConfig,
    MDNRNNConfig,
    VAEConfig,
    WorldModels,
    WorldModelsConfig,
)

World = Literal["catch", "pong"]

SETTINGS: dict[World, dict[str, Any]] = {
    "catch": {
        "env": "semrl/Catch-v0",
        "vae": VAEConfig(channels=(8, 16, 32, 32), updates=800),
        "mdn_rnn": MDNRNNConfig(hidden_size=64, sequence_decisions=24),
        "controller": ControllerConfig(dreams=32),
        "dream": DreamConfig(horizon_decisions=15),
    },
    "pong": {
        "env": "PongNoFrameskip-v4",
        "environment": EnvironmentConfig(max_noops=30),
        # The ball covers one pixel of 64 × 64: with less weight, telling its place costs more than it is worth.
        "vae": VAEConfig(channels=(8, 16, 32, 32), pixel_weight=32.0, updates=10_000, learning_rate=5e-4),
        "mdn_rnn": MDNRNNConfig(hidden_size=128, sequence_decisions=64, updates=4000),
        "controller": ControllerConfig(generations=200),
        "dream": DreamConfig(horizon_decisions=150),
    },
}
"""What is not as the defaults have it: smaller networks, on one core."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Train World Models and test them."""

    world: World = "catch"
    """Which game."""
    decisions: int = 5000
    """Budget of real play."""
    seed: int = 0
    """Of everything."""
    episodes: int = 30
    """Games of the test."""
    out: Path = Path("runs/world-models")
    """Folder of the runs; each has one of its own in it."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(arguments: Arguments) -> None:
    """Do what is missing, tell."""
    a = arguments
    config = configure(a.world, decisions=a.decisions, seed=a.seed, episodes=a.episodes)
    folder = a.out / f"{a.world}-{a.decisions}-{a.seed}-{a.episodes}"
    told = WorldModels(config, folder, lambda text: print(text, file=sys.stderr, flush=True)).run()
    scores = {name: summed_up(told[name]) for name in ("returns", "random_returns")}
    if a.json:
        row = {"world": a.world, "seed": a.seed, "score": scores["returns"], "random": scores["random_returns"]}
        print(json.dumps(row | told | {"machine": machine.describe()}))
        return
    console = Console()
    console.print(table(told, scores))
    console.print(
        f"{a.world}, seed {a.seed}: {a.decisions:,} decisions of random play, {a.episodes} games a test. Squared error "
        f"of a frame: V {told['vae_error']:.1f}, mean image {told['mean_image_error']:.1f}. Dreamt return: "
        f"{told['dreamt'][0]:.2f} in the first generation, {told['dreamt'][1]:.2f} in the last.",
        highlight=False,
    )
    console.print(machine.sentence(machine.describe()), highlight=False)


def configure(world: World, *, decisions: int, seed: int, episodes: int) -> WorldModelsConfig:
    """Return what is done for a world and a budget."""
    return WorldModelsConfig(decisions=decisions, seed=seed, test_episodes=episodes, **SETTINGS[world])


def summed_up(returns: list[float]) -> dict[str, float]:
    """Return mean, standard deviation, least and most."""
    return {"mean": float(np.mean(returns)), "std": float(np.std(returns)), "min": min(returns), "max": max(returns)}


def table(told: dict[str, Any], scores: dict[str, dict[str, float]]) -> Table:
    """Lay scores and times out."""
    laid = Table("", "mean", "std", "min", "max", box=None, padding=(0, 2, 0, 0))
    for title, name in (("C, found in the dream", "returns"), ("random play", "random_returns")):
        laid.add_row(title, *(f"{scores[name][key]:.2f}" for key in ("mean", "std", "min", "max")))
    for step, seconds in told["seconds"].items():
        laid.add_row(f"{step}, seconds", f"{seconds:.1f}")
    return laid


if __name__ == "__main__":
    try:
        main(tyro.cli(Arguments))
    except SemrlError as error:
        print(f"world_models: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, UsageError) else 1)
