"""``semrl compare``: what two runs know and do differently."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console, working
from semrl.core.errors import UsageError
from semrl.core.files import require_writable
from semrl.core.strict_json import dumps
from semrl.evaluation.comparing import compare
from semrl.evaluation.player import Policy
from semrl.evaluation.rules import MOST
from semrl.report.compare import sections, write_comparison


@dataclass(frozen=True, kw_only=True)
class CompareArguments:
    """Compare two runs: settings, concepts, rules, maps, scores, and the decisions at which they part in one same game.

    The first run plays, the second one looks on and says what it would do. Rules are paired where they depend on the
    same numbers: which object is number 0 may differ between runs that learned to see on their own.

    Example:  semrl compare runs/first runs/second --page difference.html
    """

    runs: tyro.conf.Positional[tuple[Path, Path]]
    """Folders of the two runs."""
    policy: Policy = "agent"
    """Who decides in the game."""
    seed: int | None = None
    """Of the game [default: that of the first run's evaluation]."""
    decisions: int = 500
    """Decisions of the game, at most."""
    most: int = MOST
    """Rules for each number and for the reward."""
    page: Path | None = None
    """Write an HTML page as well."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, compare, print."""
    arguments = parse(CompareArguments, argv, command="compare")
    if arguments.most < 1:
        raise UsageError(f"--most must be 1 or more, not {arguments.most}")
    if arguments.page:
        require_writable(arguments.page)
    with working(f"{arguments.runs[1]} looks on while {arguments.runs[0]} plays"):
        found = compare(
            *arguments.runs,
            policy=arguments.policy,
            seed=arguments.seed,
            decisions=arguments.decisions,
            most=arguments.most,
        )
    if arguments.page:
        write_comparison(found, arguments.page)
    if arguments.json:
        print(dumps({**found.to_dict(), "page": None if arguments.page is None else str(arguments.page)}))
        return
    for title, lines in sections(found):
        console.print(f"[bold]{title}[/bold]")
        for line in lines:
            console.print(f"  {line}", soft_wrap=True, markup=False, highlight=False)
    if arguments.page:
        console.print(f"page: {arguments.page.resolve().as_uri()}", soft_wrap=True)
