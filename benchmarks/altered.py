"""Play on in another world: the variants of a game, at evaluation only.

Trained runs play as they are. For those with a map the planner plays once more after it saw some decisions of the new
world: it turns the picture if that is how it is seen as before, and learns anew what has changed (`semrl changes`).

    python benchmarks/altered.py runs/x runs/y --episodes 10

With what looks new taken for what is known, and without, and nothing learned:

    python benchmarks/altered.py runs/x --variants "" recoloured_enemy second_ball --inherits True False --adapting 0
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import islice, product
from pathlib import Path

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.core.errors import UsageError
from semrl.evaluation import load_player
from semrl.evaluation.changes import adapted, find_changes
from semrl.evaluation.player import Player, Policy
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.perception.perception import Perception
from semrl.training.session import limited_threads


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play variants of the game."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Trained runs."""
    variants: tuple[str, ...] = (
        "", "frozen_enemy", "slow_enemy", "fast_enemy", "lazy_enemy", "two_speeds", "recoloured", "recoloured_ball",
        "recoloured_enemy", "dark_ball", "second_ball", "mirrored", "upside_down",
    )  # fmt: skip
    """What is played; "": the game as it is."""
    episodes: int = 10
    """Games of each policy in each world."""
    longest: int = 16_000
    """Decisions of a game: after 65,212 frames the cartridge of Pong ends it and sets its score back, which counts as
    points."""
    adapting: int = 1_000
    """Decisions of the new world in which it is found out what has changed, before the planner plays once more; 0: it
    does not."""
    inherits: tuple[bool, ...] = (True,)
    """Whether what looks new, or is more than there was, is taken for what is known."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """What a policy got in a variant."""

    run: str
    variant: str
    inherits: bool
    policy: str
    returns: list[float]
    mean: float
    min: float
    max: float
    decisions: float
    """Mean length of a game: of games that nobody wins, how slowly they are lost."""


def main(arguments: Arguments) -> None:
    """Play every variant and print the table."""
    if not arguments.runs:
        raise UsageError("name at least one trained run")
    scores = [score for run in arguments.runs for score in play(run, arguments)]
    if arguments.json:
        print(json.dumps({"machine": machine.describe(), "scores": [asdict(score) for score in scores]}))
        return
    table = Table(
        "run", "variant", "inherits", "policy", "mean", "min … max", "decisions a game", box=None, padding=(0, 2, 0, 0)
    )
    for score in scores:
        extremes = f"{score.min:.0f} … {score.max:.0f}"
        inherits = "yes" if score.inherits else "no"
        figures = f"{score.mean:.2f}", extremes, f"{score.decisions:,.0f}"
        table.add_row(score.run, score.variant, inherits, score.policy, *figures)
    Console().print(table)


def play(run: Path, arguments: Arguments) -> Iterator[Score]:
    """Play every variant with every policy of a run."""
    for variant, inherits in product(arguments.variants, arguments.inherits):
        player = load_player(run, memory=True).under(variant=variant)
        inherit(player, inherits)
        with limited_threads(player.config.threads):
            policies: tuple[Policy, ...] = ("agent", "planner") if player.planning else ("agent",)
            for policy in policies:
                yield _score(run, variant, inherits, policy, _games(player, policy, arguments))
            if player.planning and variant and arguments.adapting:
                unaltered = player.under(variant=None)
                again = adapted(unaltered, find_changes(unaltered, variant, decisions=arguments.adapting))
                who = f"planner, after {arguments.adapting:,} decisions"
                yield _score(run, variant, inherits, who, _games(again, "planner", arguments))


def inherit(player: Player, on: bool) -> None:
    """Switch it on, as the run has it, or off."""
    perception = getattr(player.encoder, "perception", None)
    if not on and isinstance(perception, Perception):
        none = replace(perception.config.inheritance, decisions=0, shares=False)
        perception.config = replace(perception.config, inheritance=none)


def _games(player: Player, policy: Policy, arguments: Arguments) -> list[tuple[float, int]]:
    """Play, and return of each game the return and how many decisions it took."""
    games = []
    for episode in range(arguments.episodes):
        rng = np.random.default_rng([EVALUATION_SEED, 0, episode])
        decisions = 0
        steps = player.play(player.new_game(int(rng.integers(2**31))), rng, policy)
        for step in islice(steps, arguments.longest + 1):
            total = step.total
            decisions += step.action is not None
        games.append((total, decisions))
    return games


def _score(run: Path, variant: str, inherits: bool, policy: str, games: list[tuple[float, int]]) -> Score:
    returns, decisions = zip(*games, strict=True)
    return Score(
        run=str(run),
        variant=variant or "as trained",
        inherits=inherits,
        policy=policy,
        returns=list(returns),
        mean=float(np.mean(returns)),
        min=min(returns),
        max=max(returns),
        decisions=float(np.mean(decisions)),
    )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
