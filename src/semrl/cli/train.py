"""``semrl train``: learn to see, then to play."""

import argparse
import contextlib
import dataclasses
import shlex
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from semrl.cli.arguments import parse
from semrl.cli.notes import notes_in_one_line
from semrl.cli.progress import TrainingProgress, say, show_summary
from semrl.core.errors import UsageError
from semrl.core.strict_json import dumps
from semrl.training import RunConfig, RunFolder, TrainResult, preset, train
from semrl.training.config import read_toml
from semrl.training.trainer import Observer

if TYPE_CHECKING:
    from semrl.cli.trackers import Tracker


LOOKING = "looking at the game, to count what moves in it at once"


@dataclass(frozen=True, kw_only=True)
class TrainArguments:
    """Train an agent, perception first. Every setting of the run is a flag; --preset sets them all."""

    config: Annotated[RunConfig, tyro.conf.arg(name="")]
    """Everything that decides the result."""
    run: Path | None = None
    """Folder of the run [default: runs/MODEL-ENV-SEED-TIME]."""
    resume: bool = False
    """Go on with the run in --run where its last checkpoint stands."""
    preset: str = "semrl"
    """Named settings: 'semrl' is what learns best, 'thesis' has the thesis's values."""
    config_file: Annotated[Path | None, tyro.conf.arg(name="config")] = None
    """TOML file of settings, on top of the preset and below the flags."""
    tensorboard: bool = False
    """Write TensorBoard events into the run's folder (extra 'tensorboard')."""
    mlflow: bool = False
    """Write to MLflow, where MLFLOW_TRACKING_URI says (extra 'mlflow')."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, train, print."""
    arguments = _parse(argv)
    path = arguments.run or _default_path(arguments.config)
    if arguments.resume:
        path = _checked_resume(arguments, argv)
    config = None if arguments.resume else arguments.config
    shown = RunFolder.open(path).config() if config is None else config
    trackers = _trackers(arguments, path, shown)
    with contextlib.ExitStack() as stack:
        stack.enter_context(notes_in_one_line())
        observers: list[Observer] = [stack.enter_context(TrainingProgress(shown, path))]
        observers += [stack.enter_context(tracker) for tracker in trackers]
        result = train(path, config, observers=observers, looking=lambda: say(LOOKING))
    show_result(result, as_json=arguments.json)


def _trackers(arguments: TrainArguments, path: Path, config: RunConfig) -> list["Tracker"]:
    if not (arguments.tensorboard or arguments.mlflow):
        return []
    from semrl.cli import trackers

    chosen = [trackers.tensorboard(path / "tensorboard")] if arguments.tensorboard else []
    return [*chosen, *([trackers.mlflow(path, config)] if arguments.mlflow else [])]


def show_result(result: TrainResult, *, as_json: bool) -> None:
    """Print the result for a person or for a program."""
    if as_json:
        print(dumps(dataclasses.asdict(result)))
        return
    last, run = result.return_mean_last10, shlex.quote(result.run)
    show_summary({
        "run": result.run,
        "played": f"{result.decisions:,} decisions ({result.frames:,} frames)",
        "agent's episodes": result.episodes,
        "mean return, last 10": "no episode finished" if last is None else f"{last:.1f}",
        "took": f"{result.seconds / 60:.1f} minutes",
        **({"next": f"semrl eval {run} --episodes 5"} if _can_play(Path(result.run)) else {}),
        "and": f"semrl report {run}",
    })  # fmt: skip


def _can_play(run: Path) -> bool:
    """Whether perception was ready before the budget was spent."""
    return not RunFolder.open(run).newest(prefix="perceiving").arrays["perceiving"]


def _parse(argv: Sequence[str]) -> TrainArguments:
    """Let the preset, the model and the file decide the defaults, then parse the flags on top."""
    first = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for flag in ("--preset", "--model", "--config"):
        first.add_argument(flag)
    try:
        known, _ = first.parse_known_args(argv)
    except argparse.ArgumentError as error:
        raise UsageError(str(error)) from None
    overrides: dict[str, Any] = read_toml(Path(known.config)) if known.config else {}
    name = known.preset or TrainArguments.preset
    try:
        config = preset(name, known.model, overrides)
    except UsageError as error:
        raise UsageError(f"{known.config}: {error}" if known.config else str(error)) from None
    return parse(TrainArguments, argv, command="train", default=TrainArguments(config=config, preset=name))


def _default_path(config: RunConfig) -> Path:
    game = config.env.split("/")[-1].split("NoFrameskip")[0].lower()
    return Path("runs") / f"{config.model}-{game}-{config.seed}-{time.strftime('%Y%m%d-%H%M%S')}"


def _checked_resume(arguments: TrainArguments, argv: Sequence[str]) -> Path:
    if arguments.run is None:
        raise UsageError("--resume needs --run: the folder to go on with")
    allowed = {"--run", "--resume", "--json", "--tensorboard", "--mlflow"}
    others = [word.split("=")[0] for word in argv if word.startswith("--") and word.split("=")[0] not in allowed]
    if others:
        raise UsageError(f"a resumed run keeps its settings; leave out {', '.join(others)}")
    return arguments.run
