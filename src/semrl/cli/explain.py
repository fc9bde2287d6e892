"""``semrl explain``: one decision of a run, and why it was taken."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.table import Column, Table
from rich.text import Text

from semrl.cli.arguments import parse
from semrl.cli.progress import console, error_console
from semrl.core.files import require_writable
from semrl.core.strict_json import dumps
from semrl.evaluation.explaining import explain
from semrl.evaluation.explanation import Explanation
from semrl.evaluation.player import Policy
from semrl.report import phrases
from semrl.report.explanation import write_explanation

WIDTH = 20
"""Of a scenario at least: a narrow terminal wraps words before it cuts them."""


@dataclass(frozen=True, kw_only=True)
class ExplainArguments:
    """Explain one decision of a run with a map: what was seen, where on the map that is, which way leads to a gain,
    what might come, what was done and why, and what really came.

    Episodes are those of semrl eval with the same seed, policy and conditions; it prints when the rewards of each fell.
    Episode 0 is the one that its video shows, with the number of each decision under the picture. Numbers of the state
    are in the units of semrl rules: percent of the image, RAM features in the emulator's pixels.

    Example:  semrl explain runs/first --step 120 --html why.html
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    episode: int = 0
    """Number of the evaluation episode, from 0."""
    step: int
    """Number of the decision in it, from 0."""
    policy: Policy = "agent"
    """Who decides: the agent, or the planner's best scenario alone."""
    seed: int | None = None
    """Of the episodes [default: that of semrl eval]."""
    exploration: float | None = None
    """Probability of a random action [default: what the run is configured for, 0]."""
    sticky_actions: float | None = None
    """Probability that a frame repeats the previous action [default: as in training]."""
    at: int | None = None
    """Play as the run was after so many decisions: one of its milestones [default: as it is now]."""
    html: Path | None = None
    """Also write it as one HTML page that needs no network."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play to the decision, write, print."""
    arguments = parse(ExplainArguments, argv, command="explain")
    if arguments.html:
        require_writable(arguments.html)  # what cannot be written is refused before anything is played
    asked = {"exploration": arguments.exploration, "sticky_actions": arguments.sticky_actions}
    with error_console.status(f"playing to decision {arguments.step} of episode {arguments.episode}"):
        explanation = explain(
            arguments.run,
            episode=arguments.episode,
            step=arguments.step,
            seed=arguments.seed,
            policy=arguments.policy,
            at=arguments.at,
            **{name: value for name, value in asked.items() if value is not None},
        )
    if arguments.html:
        write_explanation(explanation, arguments.html)
    if arguments.json:
        page = None if arguments.html is None else str(arguments.html)
        print(dumps(explanation.to_json() | {"html": page}))
        return
    _show(explanation)
    if arguments.html:
        console.print(f"written: {arguments.html}", soft_wrap=True, markup=False, highlight=False)


def _show(e: Explanation) -> None:
    """Tell a person, from what is seen to what came."""
    console.print(Text(f"Why {e.choice.action}?", "bold"), Text(f"{e.run}, {phrases.which(e)}", "dim"))
    console.print()
    way = {"way to a gain": phrases.way(e)} if e.path else {}
    taken = {"taken for": "; ".join(e.sight.remarks)} if e.sight.remarks else {}
    console.print(_rows({"seen": phrases.seen(e), **taken, "on the map": phrases.place(e), **way}))
    console.print()
    console.print(_scenarios(e))
    console.print()
    why = {"why the first": e.reason} | ({"what else": phrases.otherwise(e)} if e.otherwise else {})
    features = {f"plan: {part.part}": phrases.plan_feature(part) for part in e.plan_features}
    console.print(_rows({**why, **features, "done": phrases.choice(e), "came": phrases.rollout(e)}))


def _rows(values: dict[str, str]) -> Table:
    """Put names beside texts, as they are: node numbers and actions are no markup."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in values.items():
        table.add_row(Text(name, "dim", no_wrap=True), Text(value))
    return table


def _scenarios(e: Explanation) -> Table:
    title = phrases.shown_scenarios(e)
    columns = ("", Column(title, min_width=WIDTH), "return", "uncertainty", "rewards", "ends in")
    table = Table(*columns, box=None, padding=(0, 2, 0, 0), header_style="dim")
    for scenario in e.scenarios:
        row = (
            str(scenario.rank),
            phrases.compact(scenario.actions),
            phrases.signed(scenario.predicted_return),
            phrases.uncertainty(scenario),
            phrases.rewards(scenario.rewards),
            phrases.ending(e, scenario),
        )
        table.add_row(*map(Text, row), style="bold" if scenario.rank == 1 else None)
    return table
