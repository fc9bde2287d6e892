"""``semrl changes``: what is different in an altered world, and what learning just that anew is worth."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, console, show_summary
from semrl.core.errors import UsageError
from semrl.core.strict_json import dumps
from semrl.evaluation.changes import Change, Changes, find_changes, planner_returns, require_learning_anew
from semrl.evaluation.player import Player, load_player

WAYS = {
    "": "as it is",
    "mirrored": "with left and right exchanged",
    "upside_down": "with top and bottom exchanged",
    "mirrored+upside_down": "turned round by half a turn",
}
"""How people say how a picture is turned."""

Scores = tuple[list[float], list[float]]
"""Returns of the planner's games in the altered world, before and after it has learned anew."""


@dataclass(frozen=True, kw_only=True)
class ChangesArguments:
    """Let the planner of a run play in an altered world, and say what no longer comes as it was learned.

    First the picture is turned round in each way, and the way is kept in which most comes as predicted. Then each
    number that the world model predicts, the reward, and each rule about concepts is compared with the world of the
    training. With --episodes the planner plays games there, before and after it has learned anew what has changed, and
    nothing else, a tenth of it from those decisions, the rest from what it remembers. The run itself stays as it is.

    Example:  semrl changes runs/first --env-variant lazy_enemy --episodes 3
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run (models with a map)."""
    env_variant: str
    """How the game is altered, such as mirrored, fast_enemy or lazy_enemy+recoloured."""
    decisions: int = 1_000
    """Decisions of the altered world in which this is found out."""
    episodes: int = 0
    """Games that the planner plays there, before and after learning anew."""
    max_decisions: int | None = None
    """Decisions after which such a game is cut [default: what the run is configured for, 27000]."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, compare, print."""
    arguments = parse(ChangesArguments, argv, command="changes")
    if arguments.episodes < 0:
        raise UsageError(f"--episodes must be 0 or more, not {arguments.episodes}")
    player = load_player(arguments.run, memory=arguments.episodes > 0)
    player.require_predictions(arguments.run)
    if arguments.episodes:
        require_learning_anew(player)
    if arguments.max_decisions is not None:
        player = player.under(max_decisions=arguments.max_decisions)
    with PlayProgress("compare", 2 * arguments.decisions, "decisions") as progress:
        changes = find_changes(player, arguments.env_variant, decisions=arguments.decisions, on_step=progress.count)
    returns = _scores(arguments, player, changes)
    if arguments.json:
        print(dumps(_as_json(arguments, changes, returns)))
        return
    _show(changes, returns)


def _scores(arguments: ChangesArguments, player: Player, changes: Changes) -> Scores:
    """Let the planner play before and after it has learned anew."""
    if not arguments.episodes:
        return [], []
    with PlayProgress("play", 2 * arguments.episodes, "episodes") as progress:
        done = played = 0

        def on_episode(_total: float, decisions: int) -> None:
            nonlocal done, played
            done, played = done + 1, played + decisions
            progress.update(done, played)

        return planner_returns(arguments.run, player, changes, arguments.episodes, on_episode)


def _as_json(arguments: ChangesArguments, changes: Changes, returns: Scores) -> dict[str, object]:
    return {
        "run": str(arguments.run),
        "variant": changes.variant,
        "decisions": arguments.decisions,
        "reflection": changes.reflection,
        "expected": changes.expected,
        "facts": [_change_as_json(change) for change in changes.facts],
        "rules": [_change_as_json(change) for change in changes.rules],
        "returns_before": returns[0],
        "returns_after": returns[1],
    }


def _change_as_json(change: Change) -> dict[str, object]:
    return dataclasses.asdict(change) | {"broken": change.is_broken}


def _show(changes: Changes, returns: Scores) -> None:
    shares = ", ".join(f"{WAYS[name]} {share:.0%}" for name, share in changes.expected.items())
    console.print(f"[bold]the picture[/bold]  {WAYS[changes.reflection]}", soft_wrap=True, highlight=False)
    console.print(f"  all comes as predicted in: {shares}", soft_wrap=True, highlight=False)
    for title, found in (("numbers", changes.facts), ("rules", changes.rules)):
        broken = [change for change in found if change.is_broken]
        says = f"{len(broken)} of {len(found)} no longer hold" if broken else f"all {len(found)} hold as before"
        console.print(f"[bold]{title}[/bold]  {says}", soft_wrap=True, highlight=False)
        for change in broken:
            console.print(f"  {_sentence(change)}", soft_wrap=True, markup=False, highlight=False)
    before, after = returns
    if before:
        show_summary({"planner, before": _games(before), "planner, after": _games(after)})


def _sentence(change: Change) -> str:
    return (
        f"{change.about}: as learned in {change.right_now:,} of {change.times_now:,} cases here, "
        f"in {change.right_before:,} of {change.times_before:,} before"
    )


def _games(returns: Sequence[float]) -> str:
    return f"{sum(returns) / len(returns):.2f} ({', '.join(f'{one:g}' for one in returns)})"
