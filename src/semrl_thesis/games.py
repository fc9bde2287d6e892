"""Other games, unchanged: nothing in perception, map, planner or agent names Pong."""

from dataclasses import dataclass, field
from typing import Any

from semrl.evaluation.player import Policy
from semrl.sweep import Trial
from semrl_thesis.base import Context, Experiment, Scale
from semrl_thesis.frontier import TINY
from semrl_thesis.results import Number, Result
from semrl_thesis.sweep import RunSpec

MODEL = "objects-map"
POLICIES: tuple[Policy, ...] = ("agent", "planner")
ATARI = ("breakout", "freeway", "boxing")


@dataclass(frozen=True, kw_only=True)
class Tour:
    """What is run.

    Attributes
    ----------
    envs
        Name of a game → its environment.
    decisions
        Budget of each run.
    episodes
        Greedy games of each policy after training.
    overrides
        Nested settings on top of the preset.
    """

    envs: dict[str, str] = field(default_factory=lambda: {game: f"{game.title()}NoFrameskip-v4" for game in ATARI})
    decisions: int = 100_000
    episodes: int = 10
    overrides: dict[str, Any] = field(default_factory=dict)

    def runs(self) -> tuple[RunSpec, ...]:
        """Return all runs."""
        return tuple(
            RunSpec(
                preset="semrl",
                model=MODEL,
                seed=0,
                decisions=self.decisions,
                overrides={**self.overrides, "env": env},
                trials=tuple(Trial(policy=policy, episodes=self.episodes) for policy in POLICIES),
                variant=game,
            )
            for game, env in self.envs.items()
        )


def measure(tour: Tour, context: Context) -> Result:
    """Sum up all runs that are finished."""
    values: dict[str, float | None] = {}
    missing = []
    for spec in tour.runs():
        score = context.ledger.score(spec)
        if score is None:
            missing.append(spec.id)
            continue
        values[f"games/{spec.variant}/minutes"] = score.seconds / 60
        for trial in spec.trials:
            if outcome := context.ledger.outcome(spec, trial):
                of = f"games/{spec.variant}/{trial.policy}"
                values |= {f"{of}/mean": outcome.mean, f"{of}/min": outcome.min, f"{of}/max": outcome.max}
    notes = (f"not finished yet: {', '.join(missing)}",) if missing else ()
    return Result(values=values, notes=notes)


TOURS: dict[Scale, Tour] = {
    "full": Tour(),
    "quick": Tour(envs={"freeway": "FreewayNoFrameskip-v4"}, decisions=6_000, episodes=1),
    "tiny": Tour(envs={"catch": "semrl/Catch-v0"}, decisions=400, episodes=1, overrides=TINY),
}


def _numbers() -> tuple[Number, ...]:
    games = {game: None for tour in TOURS.values() for game in tour.envs}
    returns = [
        Number(id=f"games/{game}/{policy}/{what}", thesis=None, unit="return")
        for game in games
        for policy in POLICIES
        for what in ("mean", "min", "max")
    ]
    minutes = [Number(id=f"games/{game}/minutes", thesis=None, unit="minutes", better="lower") for game in games]
    return (*returns, *minutes)


EXPERIMENT = Experiment(
    name="games",
    place=10,
    title="Other games",
    section="beyond it",
    numbers=_numbers(),
    settings=TOURS,
    measure=measure,
    runs={scale: tour.runs() for scale, tour in TOURS.items()},
)
