"""What symbols and plans are worth to somebody else's agent: PPO and DQN of Stable-Baselines3 on `SemanticEnv`.

Each learns with and without the features of the plan, on the same game and budget, with the defaults of its authors
for vectors. Greedy games follow, in which nothing more is learned. A row is kept as soon as it is measured.

    python benchmarks/semantic_env.py --out runs/semantic-env [--decisions 100000] [--seeds 0 1 2] [--json]
"""

import itertools
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import machine
import tyro
from rich.console import Console
from rich.table import Table
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.evaluation import evaluate_policy

from semrl import SemanticEnv, make_env, preset
from semrl.core.files import write_text
from semrl.envs import EnvironmentConfig
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.training.session import limited_threads

AGENTS: dict[str, Any] = {"PPO": PPO, "DQN": DQN}
SETTINGS: dict[str, dict[str, Any]] = {"PPO": {}, "DQN": {"buffer_size": 100_000, "learning_starts": 5_000}}
"""What differs from their defaults: a buffer of a million places would not be filled."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Train and test both agents, with the plan and without."""

    out: Path = Path("runs/semantic-env")
    """Folder of the rows; what is there is not done again."""
    env: str = "PongNoFrameskip-v4"
    """The game."""
    decisions: int = 100_000
    """Budget of each."""
    seeds: tuple[int, ...] = (0,)
    """Of agent and perception."""
    episodes: int = 10
    """Greedy games at the end."""
    max_noops: int = 30
    """At most so many random no-op decisions at the start of a game, in training and tests."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Measure, tell."""
    arguments.out.mkdir(parents=True, exist_ok=True)
    with limited_threads(1):
        cases = itertools.product(arguments.seeds, AGENTS, (False, True))
        rows = [measured(arguments, seed, agent, plan=plan) for seed, agent, plan in cases]
        kind = machine.describe()
    if arguments.json:
        print(json.dumps({"machine": kind, "rows": rows}))
        return
    table = Table("agent", "plan", "seed", "mean", "lowest", "highest", "minutes", box=None, padding=(0, 2, 0, 0))
    for row in rows:
        returns = row["returns"]
        spread = (f"{min(returns):.0f}", f"{max(returns):.0f}")
        table.add_row(
            row["agent"], "yes" if row["plan"] else "no", str(row["seed"]), f"{row['mean']:.1f}", *spread,
            f"{row['minutes']:.1f}",
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(machine.sentence(kind), highlight=False)


def measured(arguments: Arguments, seed: int, agent: str, *, plan: bool) -> dict[str, Any]:
    """Train one agent and let it play, if that was not done yet."""
    kept = arguments.out / f"{agent}-{'plan' if plan else 'state'}-{arguments.decisions}-{seed}.json"
    if kept.exists():
        row: dict[str, Any] = json.loads(kept.read_text())
        return row
    config = replace(preset("semrl", "objects-map"), seed=seed)
    game = make_env(arguments.env, EnvironmentConfig(max_noops=arguments.max_noops))
    game.reset(seed=seed)
    env = SemanticEnv(game, config, plan=plan)
    began = time.perf_counter()
    learner = AGENTS[agent]("MultiInputPolicy", env, seed=seed, device="cpu", **SETTINGS[agent])
    learner.learn(arguments.decisions)
    minutes = (time.perf_counter() - began) / 60
    env.learn = False
    env.reset(seed=EVALUATION_SEED)
    returns, _ = evaluate_policy(learner, env, arguments.episodes, return_episode_rewards=True, warn=False)
    env.close()
    row = {
        "agent": agent, "plan": plan, "seed": seed, "env": arguments.env, "decisions": arguments.decisions,
        "returns": list(returns), "mean": sum(returns) / len(returns), "minutes": minutes,
    }  # fmt: skip
    write_text(kept, json.dumps(row, indent=2) + "\n")
    return row


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=__doc__))
