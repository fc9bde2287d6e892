"""``semrl changes``: what is different in an altered world, and what learning just that anew is worth."""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, console, show_summary
from semrl.core.errors import UsageError
from semrl.core.strict_json import dumps
from semrl.evaluation.changes import Change, Changes, adapted, find_changes, require_learning_anew
from semrl.evaluation.player import Player, load_player
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.training.session import limited_threads

WAYS = {
    "": "as it is",
    "mirrored": "with left and right exchanged",
    "upside_down": "with top and bottom exchanged",
    "mirrored+upside_down": "turned round by half a turn",
}
"""How people say how a picture is turned."""


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


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Returns of the planner's games in the altered world."""

    before: list[float]
    after: list[float]


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
    total = 2 * arguments.decisions
    with PlayProgress("compare", total, "decisions") as progress:
        changes = find_changes(player, arguments.env_variant, decisions=arguments.decisions, on_step=progress.count)
    scores = _scores(player, changes, arguments.episodes)
    if arguments.json:
        print(dumps(_as_json(arguments, changes, scores)))
        return
    _show(changes, scores)


def _scores(player: Player, changes: Changes, episodes: int) -> Scores:
    """Let the planner play before and after it has learned anew."""
    if not episodes:
        return Scores(before=[], after=[])
    with PlayProgress("play", 2 * episodes, "episodes") as progress:
        done = decisions = 0

        def on_episode(length: int) -> None:
            nonlocal done, decisions
            done, decisions = done + 1, decisions + length
            progress.update(done, decisions)

        before = _returns(player.under(variant=changes.variant), episodes, on_episode)
        return Scores(before=before, after=_returns(adapted(player, changes), episodes, on_episode))


def _returns(player: Player, episodes: int, on_episode: Callable[[int], None]) -> list[float]:
    returns, seed = [], player.config.seed + EVALUATION_SEED
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        for number in range(episodes):
            for step in player.episode(number, seed, "planner", env):
                last = step
            returns.append(last.total)
            on_episode(last.number)
    return returns


def _as_json(arguments: ChangesArguments, changes: Changes, scores: Scores) -> dict[str, object]:
    return {
        "run": str(arguments.run),
        "variant": changes.variant,
        "decisions": arguments.decisions,
        "reflection": changes.reflection,
        "expected": changes.expected,
        "facts": [_change_as_json(change) for change in changes.facts],
        "rules": [_change_as_json(change) for change in changes.rules],
        "returns_before": scores.before,
        "returns_after": scores.after,
    }


def _change_as_json(change: Change) -> dict[str, object]:
    return dataclasses.asdict(change) | {"broken": change.is_broken}


def _show(changes: Changes, scores: Scores) -> None:
    shares = ", ".join(f"{WAYS[name]} {share:.0%}" for name, share in changes.expected.items())
    console.print(f"[bold]the picture[/bold]  {WAYS[changes.reflection]}", soft_wrap=True, highlight=False)
    console.print(f"  all comes as predicted in: {shares}", soft_wrap=True, highlight=False)
    for title, found in (("numbers", changes.facts), ("rules", changes.rules)):
        broken = [change for change in found if change.is_broken]
        says = f"{len(broken)} of {len(found)} no longer hold" if broken else f"all {len(found)} hold as before"
        console.print(f"[bold]{title}[/bold]  {says}", soft_wrap=True, highlight=False)
        for change in broken:
            console.print(f"  {_sentence(change)}", soft_wrap=True, markup=False, highlight=False)
    if scores.before:
        show_summary({"planner, before": _games(scores.before), "planner, after": _games(scores.after)})


def _sentence(change: Change) -> str:
    return (
        f"{change.about}: as learned in {change.right_now:,} of {change.times_now:,} cases here, "
        f"in {change.right_before:,} of {change.times_before:,} before"
    )


def _games(returns: Sequence[float]) -> str:
    return f"{sum(returns) / len(returns):.2f} ({', '.join(f'{one:g}' for one in returns)})"
