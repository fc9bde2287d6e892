"""``semrl bench``: how fast a frame is elevated, stage by stage, or where the time of a training goes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.table import Table

from semrl.cli.arguments import parse
from semrl.cli.progress import console, working
from semrl.core.errors import UsageError
from semrl.core.files import require_writable
from semrl.core.strict_json import dumps
from semrl.training import preset
from semrl_thesis.report.speed import write_speed
from semrl_thesis.speed import SpeedConfig, measure_speed
from semrl_thesis.timing import ELEVATION, EMULATOR, STACK, Speed
from semrl_thesis.training_profile import TrainingProfile, profile_training


@dataclass(frozen=True, kw_only=True)
class BenchArguments:
    """Time every stage from a raw frame of Pong to its semantic vector, beside the emulator, on the same frames.

    Rates are per second of one core; each is the median of several passes in which the stages take turns. A frame
    stands for one decision: the emulator makes four for it.

    With --training: train a run in memory and tell where its time went, part by part, beside the emulator alone.

    Example:  semrl bench --peers --html speed.html
    """

    training: bool = False
    """Profile a training instead."""
    model: str = "objects-map"
    """Of the training, as `semrl train` takes it."""
    env: str = "PongNoFrameskip-v4"
    """Likewise."""
    preset: Literal["semrl", "thesis"] = "semrl"
    """Whose settings the training has."""
    decisions: int = 10_000
    """Budget of the training, perception included."""

    peers: bool = False
    """Also time the thesis's stack: scikit-learn, networkx and gensim (needs the extra 'thesis')."""
    frames: int = SpeedConfig.frames
    """Recorded frames in one pass."""
    rounds: int = SpeedConfig.rounds
    """Passes of every stage; the median counts."""
    seed: int = SpeedConfig.seed
    """Of the random play."""
    html: Path | None = None
    """Also write charts as one HTML page that needs no network."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, measure, write, tell."""
    arguments = parse(BenchArguments, argv, command="bench")
    if arguments.training:
        _train(arguments)
        return
    if arguments.html:
        require_writable(arguments.html)  # what cannot be written is told before anything is measured
    config = SpeedConfig(frames=arguments.frames, rounds=arguments.rounds, seed=arguments.seed)
    with working("learning to see") as say:
        speed = measure_speed(config, peers=arguments.peers, say=say)
    if arguments.html:
        write_speed(speed, arguments.html)
    if arguments.json:
        print(dumps(_as_json(speed, arguments.html)))
        return
    console.print(_stages(speed))
    console.print(_growth(speed))
    console.print(_ratios(speed), highlight=False)
    if arguments.html:
        console.print(f"page: {arguments.html.resolve().as_uri()}", soft_wrap=True)


def _train(arguments: BenchArguments) -> None:
    """Profile a training and tell."""
    if arguments.html or arguments.peers:
        raise UsageError("--html and --peers go with the speed of elevation, not with --training")
    changes = {"env": arguments.env, "seed": arguments.seed, "decisions": arguments.decisions}
    config = preset(arguments.preset, arguments.model, changes)
    with working(f"training {config.model} for {config.decisions:,} decisions"):
        profile = profile_training(config)
    if arguments.json:
        print(dumps(_profile_as_json(profile)))
        return
    table = _table("part", "share")
    for part, share in profile.shares.items():
        table.add_row(part, f"{share:.1%}")
    console.print(table)
    alone = profile.emulator_per_second
    beside = f"; the emulator alone makes {alone:,.0f}" if math.isfinite(alone) else ""
    console.print(
        f"\n{profile.training_per_second:,.0f} decisions a second of one core, "
        f"{profile.agent_per_second:,.0f} once perception was ready{beside}.",
        highlight=False,
    )


def _profile_as_json(profile: TrainingProfile) -> dict[str, object]:
    config, alone = profile.config, profile.emulator_per_second
    return {
        "model": config.model,
        "env": config.env,
        "seed": config.seed,
        "decisions": config.decisions,
        "training_per_second": profile.training_per_second,
        "agent_per_second": profile.agent_per_second,
        "emulator_per_second": alone if math.isfinite(alone) else None,
        "shares": profile.shares,
    }


def _as_json(speed: Speed, html: Path | None) -> dict[str, object]:
    stack = speed.stages.get(STACK)
    return {
        "stages": [{"name": name, "per_second": 1 / seconds} for name, seconds in speed.stages.items()],
        "elevation_per_second": 1 / speed.stages[ELEVATION],
        "emulator_per_second": 1 / speed.stages[EMULATOR],
        "thesis_stack_per_second": 1 / stack if stack else None,
        "by_objects": [
            {"objects": count, "name": name, "per_second": 1 / seconds}
            for count, stages in speed.by_objects.items()
            for name, seconds in stages.items()
        ],
        "by_vocabulary": [
            {"words": words, "per_second": 1 / seconds} for words, seconds in speed.by_vocabulary.items()
        ],
        "html": None if html is None else str(html),
    }


def _table(*columns: str) -> Table:
    table = Table(*columns, box=None, padding=(0, 2, 0, 0))
    for column in table.columns[1:]:
        column.justify = "right"
    return table


def _stages(speed: Speed) -> Table:
    table = _table("stage", "µs a frame", "per second")
    for name, seconds in speed.stages.items():
        table.add_row(name, f"{seconds * 1e6:,.1f}", f"{1 / seconds:,.0f}")
    return table


def _growth(speed: Speed) -> Table:
    table = _table("\nhow it grows", "\nµs")
    for count, stages in speed.by_objects.items():
        for name, seconds in stages.items():
            table.add_row(f"{name}, {count:,} objects a frame", f"{seconds * 1e6:,.0f}")
    for words, seconds in speed.by_vocabulary.items():
        table.add_row(f"signed hashing of a scene, {words:,} different words", f"{seconds * 1e6:,.0f}")
    return table


def _ratios(speed: Speed) -> str:
    times = {name: speed.stages[name] / speed.stages[ELEVATION] for name in (EMULATOR, STACK) if name in speed.stages}
    said = [f"{times[EMULATOR]:.2f} times as fast as the emulator"]
    if STACK in times:
        said.append(f"{times[STACK]:.1f} times as fast as the thesis's stack")
    return f"\nElevation is {' and '.join(said)}."
