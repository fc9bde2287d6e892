"""``semrl publish``: a trained run as a folder to be shared, with a model card."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import show_summary
from semrl.core.strict_json import dumps
from semrl.evaluation.player import load_player
from semrl.evaluation.publishing import publish
from semrl.evaluation.rules import rules_of
from semrl.report.card import RULES_SHOWN, write_card


@dataclass(frozen=True, kw_only=True)
class PublishArguments:
    """Write what play needs of a finished run into a new folder, with a model card as Hugging Face and others read it.

    The folder is a run: eval, rules, explain and the others work on it, and so do load_player and load_encoder. Sending
    it anywhere is yours to do.

    Example:  semrl publish runs/first --to first-pong
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    to: Path
    """The new folder."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, copy, write the card, print."""
    arguments = parse(PublishArguments, argv, command="publish")
    folder = publish(arguments.run, arguments.to)
    card = write_card(folder.path, rules_of(load_player(folder.path), most=2)[:RULES_SHOWN])
    size = sum(path.stat().st_size for path in folder.path.rglob("*") if path.is_file())
    if arguments.json:
        print(dumps({"run": str(arguments.run), "folder": str(folder.path), "card": str(card), "bytes": size}))
        return
    show_summary({"folder": folder.path, "size": f"{size / 1e6:.1f} MB", "card": card})
