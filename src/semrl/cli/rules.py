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
from semrl.world_model.rules import Rule, sentence


@dataclass(frozen=True, kw_only=True)
class RulesArguments:
    """Print what a run has learned of its world, in rules that can be checked.

    Where things are followed, they are about concepts of things: what turns them, what brings rewards, what actions do;
    each with how often it held in the newest play, and an "otherwise". Velocities are pixels a decision.

    With --trees, and where things are not followed, they are those by which the run predicts: its first forest's trees,
    pruned to the rules that say most. Places of objects are in percent of the image, from the left and from the top;
    RAM features in the emulator's pixels. Each has a name, by which `semrl knowledge RUN disable NAME` switches it off;
    those that are printed without --most.

    Example:  semrl rules runs/first
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    most: int = 8
    """Rules for each number and for the reward."""
    trees: bool = False
    """Print those of the trees, by which the run predicts."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, read, print."""
    arguments = parse(RulesArguments, argv, command="rules")
    found = load_rules(arguments.run, most=arguments.most, trees=arguments.trees)
    if arguments.json:
        rules = [_named(rule) | asdict(rule) for rule in found]
        print(dumps({"run": str(arguments.run), "rules": rules}))
        return
    for about, group in groupby(found, key=lambda rule: rule.about):
        console.print(f"[bold]{about}[/bold]")
        for rule in group:
            said = "  ".join([*_named(rule).values(), sentence(rule)])
            console.print(f"  {said}", soft_wrap=True, markup=False, highlight=False)


def _named(rule: Rule) -> dict[str, str]:
    """Return the name of a rule that can be switched off: what is predicted by, and claims nothing else."""
    return {} if rule.claim else {"name": rule.key}
