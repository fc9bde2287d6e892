"""``semrl rules``: what a run has learned of its world, in sentences."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

import tyro
from rich.markup import escape

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, console, error_console
from semrl.core.errors import MissingExtraError, NoEnvironmentError, UsageError
from semrl.core.strict_json import dumps
from semrl.evaluation.player import load_player
from semrl.evaluation.rule_check import CHECKED_DECISIONS, check_rules
from semrl.evaluation.rules import load_rules, with_checks
from semrl.world_model.lifted.checking import Check
from semrl.world_model.rules import Rule, sentence


@dataclass(frozen=True, kw_only=True)
class RulesArguments:
    """Print what a run has learned of its world, in rules that can be checked.

    Where things are followed, they are about concepts of things: what turns them, what brings rewards, what actions do;
    each with how often it held in the newest play, and an "otherwise". Velocities are pixels a decision. What comes
    within two decisions counts. Behind each list is how often it says what the world model predicts that plans are made
    with, and how often either is right, in new play of the agent.

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
    check: int = CHECKED_DECISIONS
    """Decisions of new play in which rules about concepts are checked; 0: they are not."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, read, check, print."""
    arguments = parse(RulesArguments, argv, command="rules")
    if arguments.check < 0:
        raise UsageError(f"--check must be 0 or more, not {arguments.check}")
    found = load_rules(arguments.run, most=arguments.most, trees=arguments.trees)
    checks = _checks(arguments) if arguments.check and any(rule.claim for rule in found) else []
    if arguments.json:
        rules = [_named(rule) | asdict(rule) for rule in found]
        print(dumps({"run": str(arguments.run), "rules": rules, "checks": [asdict(check) for check in checks]}))
        return
    for about, group in groupby(with_checks(found, checks), key=lambda one: one[0].about):
        console.print(f"[bold]{about}[/bold]")
        for rule, check in group:
            said = "  ".join([*_named(rule).values(), sentence(rule)])
            console.print(f"  {said}", soft_wrap=True, markup=False, highlight=False)
            if check:
                console.print(f"    {check}", soft_wrap=True, markup=False, highlight=False, style="dim")


def _checks(arguments: RulesArguments) -> list[Check]:
    """Play and check; without the environment, say that this was not done."""
    with PlayProgress("check", arguments.check, "decisions") as progress:
        try:
            return check_rules(load_player(arguments.run), decisions=arguments.check, on_step=progress.count)
        except (NoEnvironmentError, MissingExtraError) as error:
            error_console.print(f"not checked: {escape(str(error))}", soft_wrap=True)
            return []


def _named(rule: Rule) -> dict[str, str]:
    """Return the name of a rule that can be switched off: what is predicted by, and claims nothing else."""
    return {} if rule.claim else {"name": rule.key}
