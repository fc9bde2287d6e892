"""``semrl rules``: what a run has learned of its world, in sentences."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console
from semrl.core.strict_json import dumps
from semrl.evaluation.rules import load_rules
from semrl.world_model.rules import sentence


@dataclass(frozen=True, kw_only=True)
class RulesArguments:
    """Print the rules by which a run predicts what comes next: what changes by how much, and when.

    They are its first forest's trees, pruned to the rules that say most. Places of objects are in percent of the image,
    from the left and from the top; RAM features in the emulator's pixels. Each has a name, by which
    `semrl knowledge RUN disable NAME` switches it off; those that are printed without --most.

    Example:  semrl rules runs/first --most 5
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    most: int = 8
    """Rules for each number and for the reward."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, read, print."""
    arguments = parse(RulesArguments, argv, command="rules")
    found = load_rules(arguments.run, most=arguments.most)
    if arguments.json:
        print(dumps({"run": str(arguments.run), "rules": [{"name": rule.key, **asdict(rule)} for rule in found]}))
        return
    for about, group in groupby(found, key=lambda rule: rule.about):
        console.print(f"[bold]{about}[/bold]")
        for rule in group:
            console.print(f"  {rule.key}  {sentence(rule)}", soft_wrap=True, markup=False, highlight=False)
