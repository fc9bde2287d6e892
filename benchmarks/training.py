"""How fast each model trains, and how much memory it takes at most.

Each model of Table 4.1 is trained in a fresh process of its own, one after the other, on one thread:

1. Perception is learned on random play, cut short (fewer batches until stability is judged, fewer documents):
   that changes neither the time nor the memory of what follows by much.
2. The agent plays until its initial buffer is full and it learns.
3. The replay buffer is filled to its capacity (100,000 observations) by adding those already in it again and
   again, without learning. So every byte of it is in memory, as after hours of play; what the agent learns
   from it afterwards is worthless, but takes the same time.
4. The agent goes on playing and learning for some seconds: decisions a second, the median of short stretches.
5. A checkpoint of everything is written, as every run does now and then.
6. A second fresh process goes on from the checkpoint, as ``semrl train --resume`` does.

Memory is the peak of the whole process (``ru_maxrss``): of the first after 5, of the second after 6.

    python benchmarks/training.py [MODEL ...] [--preset thesis|semrl] [--seconds S] [--json]
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.agents import DQN
from semrl.agents.replay import ReplayBuffer
from semrl.training import RunFolder, build_trainer, preset
from semrl.training.checkpoint import Checkpoint
from semrl.training.config import MODELS
from semrl.training.session import limited_threads
from semrl.training.trainer import Trainer
from semrl_thesis.sweep import PIXELS

STRETCH_SECONDS = 1.0
TRAIN, RESUME = "--train-here", "--resume-here"
"""First arguments of the processes that measure."""

PIXELS_GB, VECTORS_GB = 2.0, 1.0
"""What models that see images, and those that see vectors, should stay below."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Measure the training of models: decisions a second and peak memory."""

    models: Annotated[tuple[str, ...], tyro.conf.Positional] = tuple(MODELS)
    """Which models."""
    preset: Literal["semrl", "thesis"] = "semrl"
    """Whose settings."""
    seconds: float = 8.0
    """How long each model trains after its replay buffer was filled."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Measure each model in a process of its own and tell."""
    rows = [measure(model, arguments) for model in arguments.models]
    with limited_threads(1):
        kind = machine.describe()
    if arguments.json:
        print(json.dumps({"machine": kind, "preset": arguments.preset, "seconds": arguments.seconds, "models": rows}))
        return
    names = ("model", "decisions/s", "updates/s", "training, GB", "resuming, GB", "limit, GB", "")
    table = Table(*names, box=None, padding=(0, 2, 0, 0))
    for column in table.columns[1:6]:
        column.justify = "right"
    for row in rows:
        table.add_row(
            row["model"],
            f"{row['decisions_per_second']:,.0f}",
            f"{row['updates_per_second']:,.0f}",
            f"{row['training_gb']:.2f}",
            f"{row['resuming_gb']:.2f}",
            f"{row['limit_gb']:g}",
            "below" if row["below_limit"] else "ABOVE",
        )
    console = Console()
    console.print(table)
    console.print(
        f"Preset {arguments.preset}, Pong; replay buffer filled with repeated observations before measuring; "
        f"{arguments.seconds:g} s each. 'below': both memory figures are.",
        highlight=False,
    )
    console.print(machine.sentence(kind), highlight=False)


def measure(model: str, arguments: Arguments) -> dict[str, Any]:
    """Measure one model in new processes, so that its memory is nobody else's."""
    print(f"measuring {model} …", file=sys.stderr)
    with tempfile.TemporaryDirectory() as place:
        run = str(Path(place) / "run")
        row = in_fresh_process(TRAIN, run, model, arguments.preset, str(arguments.seconds))
        row |= in_fresh_process(RESUME, run)
    limit = PIXELS_GB if MODELS[model].encoder in PIXELS else VECTORS_GB
    below = max(row["training_gb"], row["resuming_gb"]) < limit
    return {"model": model, **row, "limit_gb": limit, "below_limit": below}


def in_fresh_process(*words: str) -> dict[str, Any]:
    """Run this file anew and return what it tells."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, *words]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def train_here(run: str, model: str, name: str, seconds: str) -> dict[str, Any]:
    """Train one model in this process: steps 1 to 5 above."""
    short = {"stability": {"batches": 50, "max_batches": 400}, "perception": {"doc2vec": {"documents": 300}}}
    config = preset(name, model, short)
    with limited_threads(1):
        trainer = build_trainer(config)
        while trainer.perceiving:
            advance(trainer, 1)
        advance(trainer, config.dqn.learning_starts + 4)
        agent = trainer.agent
        assert isinstance(agent, DQN), "which agent the presets have"
        fill_replay(agent.replay)
        rate, updates = speed(trainer, agent, float(seconds))
        folder = RunFolder.create(Path(run), config)
        playable = frozenset(trainer.inference_arrays())
        folder.save(Checkpoint(arrays=trainer.to_arrays(), metrics_rows=0, seconds=0.0, playable=playable))
    return {
        "decisions_per_second": rate,
        "updates_per_second": updates,
        "replay": len(agent.replay),
        "training_gb": peak_gb(),
    }


def resume_here(run: str) -> dict[str, Any]:
    """Go on with the run in this process: step 6 above."""
    folder = RunFolder.open(Path(run))
    config = folder.config()
    with limited_threads(1):
        trainer = build_trainer(config)
        checkpoint = folder.load()
        assert checkpoint is not None
        trainer.from_arrays(checkpoint.arrays)
        advance(trainer, 4)
    return {"resuming_gb": peak_gb()}


def advance(trainer: Trainer, decisions: int) -> None:
    """Play on for some decisions."""
    trainer.decisions = trainer.decisions_ + decisions
    trainer.run()


def fill_replay(replay: ReplayBuffer) -> None:
    """Add what is in the replay buffer again and again until it is full."""
    entries = {key: np.copy(value) for key, value in replay.to_arrays().items() if key != "count"}
    n = len(entries["actions"])
    for i in range(replay.capacity - n):
        one = {key: value[i % n] for key, value in entries.items()}
        replay.add(
            one["observations"],
            one["plans"],
            int(one["actions"]),
            float(one["rewards"]),
            terminated=bool(one["terminated"]),
            start=bool(one["starts"]),
        )
    assert len(replay) == replay.capacity


def speed(trainer: Trainer, agent: DQN, seconds: float) -> tuple[float, float]:
    """Return decisions and updates a second: medians over stretches of about a second."""
    rates: list[float] = []
    decisions, updates = trainer.decisions_, agent.updates_
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        first, start = trainer.decisions_, time.perf_counter()
        while (elapsed := time.perf_counter() - start) < STRETCH_SECONDS:
            advance(trainer, 4)
        rates.append((trainer.decisions_ - first) / elapsed)
    rate = float(np.median(rates))
    return rate, rate * (agent.updates_ - updates) / (trainer.decisions_ - decisions)


def peak_gb() -> float:
    """Return the most memory this process ever had, in GB."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


if __name__ == "__main__":
    if sys.argv[1:2] == [TRAIN]:
        print(json.dumps(train_here(*sys.argv[2:])))
    elif sys.argv[1:2] == [RESUME]:
        print(json.dumps(resume_here(*sys.argv[2:])))
    else:
        main(tyro.cli(Arguments))
