"""Ten games, unchanged: nothing in perception, map, planner or agent names one."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semrl.evaluation.player import Policy
from semrl.sweep import Trial
from semrl_thesis.base import Context, Experiment, Scale
from semrl_thesis.frontier import TINY
from semrl_thesis.results import Number, Result
from semrl_thesis.sweep import RunSpec
from semrl_thesis.trials import Outcome

MODEL = "objects-map"
POLICIES: tuple[Policy, ...] = ("agent", "planner")


@dataclass(frozen=True, kw_only=True)
class Played:
    """A game, and what others score in it (Wang et al., "Dueling Network Architectures", 2016)."""

    env: str
    random: float | None = None
    human: float | None = None
    """Mean scores of random play and of a person; None where nobody has said so."""

    def normalised(self, score: float) -> float | None:
        """Return a score of which random play has 0 and a person 1."""
        if self.random is None or self.human is None:
            return None
        return (score - self.random) / (self.human - self.random)


ATARI = {
    "pong": Played(env="PongNoFrameskip-v4", random=-20.7, human=14.6),
    "breakout": Played(env="BreakoutNoFrameskip-v4", random=1.7, human=30.5),
    "freeway": Played(env="FreewayNoFrameskip-v4", random=0.0, human=29.6),
    "boxing": Played(env="BoxingNoFrameskip-v4", random=0.1, human=12.1),
    "asterix": Played(env="AsterixNoFrameskip-v4", random=210.0, human=8503.3),
    "ms-pacman": Played(env="MsPacmanNoFrameskip-v4", random=307.3, human=6951.6),
    "seaquest": Played(env="SeaquestNoFrameskip-v4", random=68.4, human=42054.7),
    "kangaroo": Played(env="KangarooNoFrameskip-v4", random=52.0, human=3035.0),
    "demon-attack": Played(env="DemonAttackNoFrameskip-v4", random=152.1, human=1971.0),
    "space-invaders": Played(env="SpaceInvadersNoFrameskip-v4", random=148.0, human=1668.7),
}


@dataclass(frozen=True, kw_only=True)
class Tour:
    """What is run.

    Attributes
    ----------
    games
        Name of a game → what it is.
    seeds
        Of the runs in each.
    decisions
        Budget of each run.
    episodes
        Greedy games of each policy after training.
    overrides
        Nested settings on top of the preset.
    """

    games: dict[str, Played] = field(default_factory=lambda: ATARI)
    seeds: tuple[int, ...] = (0, 1, 2)
    decisions: int = 100_000
    episodes: int = 10
    overrides: dict[str, Any] = field(default_factory=dict)

    def runs(self) -> tuple[RunSpec, ...]:
        """Return all runs, the first seed of every game first."""
        return tuple(
            RunSpec(
                preset="semrl",
                model=MODEL,
                seed=seed,
                decisions=self.decisions,
                overrides={**self.overrides, "env": played.env},
                trials=tuple(Trial(policy=policy, episodes=self.episodes) for policy in POLICIES),
                variant=game,
            )
            for seed in self.seeds
            for game, played in self.games.items()
        )


def measure(tour: Tour, context: Context) -> Result:
    """Sum up all runs that are finished."""
    values: dict[str, float | None] = {}
    for game, played in tour.games.items():
        specs = [spec for spec in tour.runs() if spec.variant == game]
        scores = [score for spec in specs if (score := context.ledger.score(spec))]
        if not scores:
            continue
        values[f"games/{game}/minutes"] = float(np.median([score.seconds / 60 for score in scores]))
        for trial in specs[0].trials:
            held = [outcome for spec in specs if (outcome := context.ledger.outcome(spec, trial))]
            values |= {f"games/{game}/{trial.policy}/{what}": value for what, value in _summed_up(played, held).items()}
    for policy in POLICIES:
        values |= _over_games(policy, [values.get(f"games/{game}/{policy}/normalised") for game in tour.games])
    missing = [spec.id for spec in tour.runs() if context.ledger.score(spec) is None]
    notes = (f"not finished yet: {', '.join(missing)}",) if missing else ()
    return Result(values=values, notes=notes)


def _summed_up(played: Played, outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Return the mean of the seeds' means, the worst and best game of all, and the normalised mean."""
    if not outcomes:
        return {}
    mean = float(np.mean([outcome.mean for outcome in outcomes]))
    least, most = min(outcome.min for outcome in outcomes), max(outcome.max for outcome in outcomes)
    normalised = played.normalised(mean)
    return {"mean": mean, "min": least, "max": most} | ({} if normalised is None else {"normalised": normalised})


def _over_games(policy: Policy, scores: Sequence[float | None]) -> dict[str, float | None]:
    """Return mean and median of the normalised scores; nothing before there is one of every game."""
    known = [score for score in scores if score is not None]
    if not known or len(known) < len(scores):
        return {}
    return {
        f"games/{policy}/normalised-mean": float(np.mean(known)),
        f"games/{policy}/normalised-median": float(np.median(known)),
    }


TOURS: dict[Scale, Tour] = {
    "full": Tour(),
    "quick": Tour(games={"freeway": ATARI["freeway"]}, seeds=(0,), decisions=6_000, episodes=1),
    "tiny": Tour(games={"catch": Played(env="semrl/Catch-v0")}, seeds=(0,), decisions=400, episodes=1, overrides=TINY),
}


def _numbers() -> tuple[Number, ...]:
    games = {game: played for tour in TOURS.values() for game, played in tour.games.items()}
    returns = [
        Number(id=f"games/{game}/{policy}/{what}", thesis=None, unit="return")
        for game in games
        for policy in POLICIES
        for what in ("mean", "min", "max")
    ]
    normalised = [
        Number(id=f"games/{game}/{policy}/normalised", thesis=None, unit="share")
        for game in ATARI
        for policy in POLICIES
    ]
    over_games = [
        Number(id=f"games/{policy}/normalised-{what}", thesis=None, unit="share")
        for policy in POLICIES
        for what in ("mean", "median")
    ]
    minutes = [Number(id=f"games/{game}/minutes", thesis=None, unit="minutes", better="lower") for game in games]
    return (*returns, *normalised, *over_games, *minutes)


EXPERIMENT = Experiment(
    name="games",
    place=10,
    title="Ten games",
    section="beyond it",
    numbers=_numbers(),
    settings=TOURS,
    measure=measure,
    runs={scale: tour.runs() for scale, tour in TOURS.items()},
)
