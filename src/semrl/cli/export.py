"""``semrl export``: play of a trained run as a data set that others learn from offline."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console, error_console, show_summary
from semrl.core.strict_json import dumps
from semrl.evaluation.exporting import export_play
from semrl.evaluation.player import Policy


@dataclass(frozen=True, kw_only=True)
class ExportArguments:
    """Let a run play, and write facts, concepts, actions and rewards as a data set in Minari's format.

    It needs the extra 'minari'. Episodes are those of semrl eval with the same seed.

    For example
      semrl export runs/first --to datasets
      MINARI_DATASETS_PATH=datasets minari show semrl/first-v0
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    to: Path
    """Folder of data sets; it may hold others."""
    episodes: int = 10
    """Episodes to be played."""
    policy: Policy = "agent"
    """Who decides: the agent, or the planner's best scenario alone."""
    seed: int | None = None
    """Of the episodes [default: that of semrl eval]."""
    frames: bool = False
    """Write the frames as well; they take most of the room."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, write, print."""
    arguments = parse(ExportArguments, argv, command="export")
    with error_console.status(f"playing {arguments.run}"):
        made = export_play(
            arguments.run,
            arguments.to,
            episodes=arguments.episodes,
            policy=arguments.policy,
            seed=arguments.seed,
            frames=arguments.frames,
        )
    if arguments.json:
        print(dumps(asdict(made)))
        return
    show_summary({"data set": made.dataset, "episodes": made.episodes, "decisions": f"{made.decisions:,}"})
    console.print(
        f"MINARI_DATASETS_PATH={made.folder} minari show {made.dataset}", soft_wrap=True, markup=False, highlight=False
    )
