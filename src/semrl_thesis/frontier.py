"""How far it gets in 100,000 decisions: the agents on tracked objects, the planner alone, and somebody else's agent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semrl.core.errors import MissingExtraError
from semrl.evaluation.player import Policy
from semrl.sweep import Trial
from semrl.training.config import MODELS as ALL_MODELS
from semrl_thesis.base import Context, Experiment, Scale
from semrl_thesis.baselines import VIEWS, Match, View, compete, result_name
from semrl_thesis.figures import Curve, Curves, Figure
from semrl_thesis.ledger import Ledger
from semrl_thesis.results import Number, Result
from semrl_thesis.scores import LOST
from semrl_thesis.sweep import RunSpec
from semrl_thesis.trials import Outcome

MODELS = ("objects", "objects-map")


@dataclass(frozen=True, kw_only=True)
class Race:
    """What is run.

    Attributes
    ----------
    decisions
        Budget of each run.
    seeds
        Model → seeds of its runs. The one without a map is there for comparison.
    milestones
        Decisions after which the planner is tested on the way; the agent from the second on.
    episodes
        Games of a test at the end, of one with sticky actions, and of one on the way.
    overrides
        Nested settings on top of the preset.
    match
        What the baseline is given, and how sticky actions are for all.
    """

    decisions: int = 100_000
    seeds: Mapping[str, tuple[int, ...]] = field(
        default_factory=lambda: {"objects": (0, 1, 2), "objects-map": tuple(range(10))}
    )
    milestones: tuple[int, ...] = (3_000, 25_000, 50_000)
    episodes: tuple[int, int, int] = (30, 10, 5)
    overrides: dict[str, Any] = field(default_factory=dict)
    match: Match = field(default_factory=Match)

    def trials(self, policy: Policy) -> tuple[Trial, ...]:
        """Return how a policy is tested; the first trial is the one that counts."""
        last, sticky, earlier = self.episodes
        on_the_way = self.milestones if policy == "planner" else self.milestones[1:]
        return (
            Trial(policy=policy, episodes=last),
            Trial(policy=policy, episodes=sticky, sticky_actions=self.match.sticky_actions),
            *(Trial(policy=policy, episodes=earlier, at=at) for at in on_the_way),
        )

    def runs(self) -> tuple[RunSpec, ...]:
        """Return all runs."""
        return tuple(
            RunSpec(
                preset="semrl",
                model=model,
                seed=seed,
                decisions=self.decisions,
                overrides={**self.overrides, "milestones": list(self.milestones)},
                trials=tuple(trial for policy in policies(model) for trial in self.trials(policy)),
            )
            for model in MODELS
            for seed in self.seeds[model]
        )


def policies(model: str) -> tuple[Policy, ...]:
    """Return who can play after a run of a model."""
    return ("agent", "planner") if ALL_MODELS[model].plans else ("agent",)


def measure(race: Race, context: Context) -> Result:
    """Sum up all runs that are finished; when all are, let the baseline compete."""
    values: dict[str, float | None] = {}
    curves = []
    for model in MODELS:
        specs = [spec for spec in race.runs() if spec.model == model and context.ledger.score(spec)]
        values[f"frontier/{model}/minutes"] = _middle(
            [score.seconds / 60 for score in map(context.ledger.score, specs) if score]
        )
        for policy in policies(model):
            id_, trials = f"frontier/{model}/{policy}", race.trials(policy)
            values |= _ends(id_, _held(context.ledger, specs, trials[0]))
            values[f"{id_}/sticky"] = _mean(_held(context.ledger, specs, trials[1]))
            way = {trial.at: _mean(_held(context.ledger, specs, trial)) for trial in trials[2:]}
            values |= {f"{id_}/at-{at}": mean for at, mean in way.items()}
            curves.append(_curve(f"{model}, {policy}", way, race.decisions, values[f"{id_}/mean"]))
    missing = [spec.id for spec in race.runs() if not context.ledger.score(spec)]
    ready = [view for view in VIEWS if not missing or context.kept(result_name(view, race.match)).exists()]
    notes, lacks = [], []
    try:
        values |= _rivals(ready, race.match, context)
    except MissingExtraError as error:
        notes, lacks = [str(error)], [error.extra]
    if missing:
        notes.append(f"not finished yet: {', '.join(missing)}; then Stable-Baselines3's DQN competes")
    return Result(values=values, figures=(_figure(curves),), notes=tuple(notes), lacks=tuple(lacks))


def _rivals(views: Sequence[View], match: Match, context: Context) -> dict[str, float]:
    """Return the numbers of Stable-Baselines3's DQN."""
    values: dict[str, float] = {}
    for view in views:
        context.say(f"Stable-Baselines3's DQN, {view}")
        scores = compete(view, match, context.kept(result_name(view, match)))
        values |= {f"frontier/sb3-{view}/{what}": number for what, number in scores.items()}
    return values


def _held(ledger: Ledger, specs: Sequence[RunSpec], trial: Trial) -> list[Outcome]:
    return [outcome for spec in specs if (outcome := ledger.outcome(spec, trial))]


def _ends(id_: str, held: Sequence[Outcome]) -> dict[str, float | None]:
    """Sum up the test that counts, over all seeds."""
    seeds = [outcome.mean for outcome in held]
    return {
        f"{id_}/mean": _mean(held),
        f"{id_}/lowest-seed": min(seeds, default=None),
        f"{id_}/seeds": float(len(seeds)) or None,
        f"{id_}/different-games": _middle([outcome.different for outcome in held]),
    }


def _mean(held: Sequence[Outcome]) -> float | None:
    return float(np.mean([outcome.mean for outcome in held])) if held else None


def _middle(numbers: Sequence[float]) -> float | None:
    return float(np.median(numbers)) if numbers else None


def _curve(label: str, way: dict[int | None, float | None], last: int, mean: float | None) -> Curve:
    points = [(at, value) for at, value in {**way, last: mean}.items() if at is not None and value is not None]
    x, y = np.array(points, np.float64).reshape(-1, 2).T
    return Curve(label=label, x=x, y=y)


def _figure(curves: Sequence[Curve]) -> Figure:
    drawn = tuple(curve for curve in curves if len(curve.x))
    return Figure(
        number="E.2",
        title="Score over the decisions learned from",
        says="Mean return of greedy games with random starts, all seeds, of agents and planner as they were then.",
        panels=(("", Curves(xlabel="decisions", ylabel="return", curves=drawn)),) if drawn else (),
    )


def _numbers() -> tuple[Number, ...]:
    def number(id_: str, what: str, thesis: float | None = None, unit: str = "return") -> Number:
        return Number(
            id=f"frontier/{id_}/{what}", thesis=thesis, unit=unit, better="lower" if unit == "minutes" else "higher"
        )

    numbers = []
    for model in MODELS:
        for policy in policies(model):
            of, alone = f"{model}/{policy}", LOST if policy == "planner" else None
            numbers += [
                number(of, what, alone if what == "mean" else None) for what in ("mean", "lowest-seed", "sticky")
            ]
            numbers += [number(of, f"at-{trial.at}") for trial in Race().trials(policy)[2:]]
            numbers += [number(of, "seeds", unit="seeds"), number(of, "different-games", unit="games")]
        numbers.append(number(model, "minutes", unit="minutes"))
    for view in VIEWS:
        numbers += [number(f"sb3-{view}", what) for what in ("mean", "std", "sticky")]
        numbers.append(number(f"sb3-{view}", "minutes", unit="minutes"))
    return tuple(numbers)


TINY = {
    "env": "semrl/Catch-v0",
    "perception": {"foreground": {"background_frames": 20}, "slot_assigner": {"frames": 30}},
    "stability": {"batches": 5, "max_batches": 20, "decisions": 60},
    "dqn": {"network": {"hidden_units": [8]}, "batch_size": 8, "learning_starts": 20, "train_freq": 10},
    "planning": {
        "scenarios": {"depth": 4, "scenarios": 6},
        "trees": {"first_decisions": 40, "new_decisions": 30},
    },
}
"""Everything learns in a second."""

ONE_SEED = dict.fromkeys(MODELS, (0,))

RACES: dict[Scale, Race] = {
    "full": Race(),
    "quick": Race(
        decisions=8_000,
        seeds=ONE_SEED,
        milestones=(4_000, 5_000, 6_000),
        episodes=(1, 1, 1),
        match=Match(decisions=2_000, learning_starts=500, episodes=1),
    ),
    "tiny": Race(
        decisions=400,
        seeds=ONE_SEED,
        milestones=(250, 300, 350),
        episodes=(1, 1, 1),
        overrides=TINY,
        match=Match(decisions=40, learning_starts=20, episodes=1),
    ),
}

EXPERIMENT = Experiment(
    name="frontier",
    place=9,
    title="The frontier: 100,000 decisions",
    section="§4.3, and beyond",
    numbers=_numbers(),
    settings=RACES,
    measure=measure,
    runs={scale: race.runs() for scale, race in RACES.items()},
)
