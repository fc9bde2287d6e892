"""Final results on Pong (§4.3): Table 4.1, learning curves, and the planner alone."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from semrl.evaluation.statistics import interquartile_mean
from semrl.training.config import MODELS
from semrl.training.metrics import running_mean
from semrl_thesis.base import Context, Experiment, Scale
from semrl_thesis.figures import Curve, Curves, Figure
from semrl_thesis.ledger import summed_up
from semrl_thesis.results import Number, Result
from semrl_thesis.sweep import RunSpec, Sweep

TABLE = {
    "baseline": (20.8, 21, 20, 0.42),
    "otsu": (20.1, 21, 18, 1.19),
    "birch": (20.4, 21, 18, 0.96),
    "semantic": (13.6, 20, -10, 9.60),
    "semantic-map": (14.1, 21, 3, 6.26),
    "ram": (-6.4, 4, -12, 4.55),
    "ram-map": (-0.6, 8, -6, 4.76),
}
"""Table 4.1: mean, max, min and standard deviation of the last ten episodes."""

LOST = -21
"""Return of a game in which no point is scored: what the thesis says of the planner alone."""

SWEEPS: dict[Scale, Sweep] = {
    "full": Sweep(
        decisions={"thesis": 2_000_000, "semrl": 500_000},
        seeds={"thesis": ((0,), (0, 1, 2)), "semrl": ((0,), (0, 1, 2))},
        models=tuple(TABLE),
        # Who wins every game by the same line forgets all others: what is remembered is 100,000 decisions of that line.
        # Five times the play of the preset: as many updates as with a fifth of it.
        presets={"semrl": {"environment": {"max_noops": 30}, "dqn": {"train_freq": 4}}},
    ),
    "quick": Sweep(
        decisions={"thesis": 8_000, "semrl": 8_000},
        seeds={"thesis": ((0,), (0,)), "semrl": ((0,), (0,))},
        models=tuple(TABLE),
        overrides={
            "perception": {"doc2vec": {"documents": 1000}},
            "dqn": {"learning_starts": 500, "exploration_decisions": 2_000},
            "planning": {"networks": {"next_state": {"epochs": 5}}},
            "evaluation": {"max_noops": 0},
        },
        planner_episodes=1,
    ),
    "tiny": Sweep(
        decisions={"semrl": 1_200},
        seeds={"semrl": ((0,), (0,))},
        models=("ram-map", "semantic-map"),
        overrides={
            "dqn": {"network": {"hidden_units": [8]}, "batch_size": 8, "train_freq": 50},
            "perception": {
                "hashed": {"dimension": 16},
                "otsu": {"threshold_frames": 5},
                "scene": {"scenery_frames": 5},
                "foreground": {"background_frames": 20},
                "slot_assigner": {"frames": 30},
            },
            "stability": {"batches": 5, "max_batches": 20},
            "evaluation": {"max_noops": 0},
            "models": {
                "ram-map": {
                    "planning": {"scenarios": {"depth": 3, "scenarios": 4}, "trees": {"first_decisions": 200}},
                },
                "semantic-map": {
                    "env": "semrl/Catch-v0",
                    "encoder": "scene",
                    "planning": {
                        "world_model": "networks",
                        "scenarios": {"depth": 1, "scenarios": 0},
                        "networks": {
                            "next_state": {"epochs": 1, "hidden_units": [16]},
                            "reward": {"epochs": 1, "hidden_units": [8], "kind": "network"},
                        },
                    },
                },
            },
        },
        planner_episodes=1,
    ),
}


def measure(runs: Mapping[str, Sequence[RunSpec]], context: Context) -> Result:
    """Sum up all runs that are finished."""
    values: dict[str, float | None] = {}
    for preset, specs in runs.items():
        suffix = "" if preset == "thesis" else f"@{preset}"
        for model in TABLE:
            done = [spec for spec in specs if spec.model == model and context.ledger.score(spec)]
            values |= {f"{id_}{suffix}": value for id_, value in _values(model, done, context).items()}
    missing = [spec.id for specs in runs.values() for spec in specs if not context.ledger.score(spec)]
    notes = (f"not finished yet: {', '.join(missing)}",) if missing else ()
    return Result(values=values, figures=_figures(runs, context), notes=notes)


def _values(model: str, done: Sequence[RunSpec], context: Context) -> dict[str, float | None]:
    """Sum up the finished runs of one model, all their last episodes together."""
    returns = [last for last in map(context.ledger.last_returns, done) if len(last)]
    values: dict[str, float | None] = {}
    if done:
        together = np.concatenate([np.zeros(0), *returns])
        values = {f"table4.1/{model}/{name}": value for name, value in summed_up(together).items()}
    if returns:
        names = ("iqm", "iqm-low", "iqm-high")
        values |= {f"table4.1/{model}/{n}": v for n, v in zip(names, interquartile_mean(returns), strict=True)}
    planned = [score.planner for spec in done if (score := context.ledger.score(spec)) and score.planner is not None]
    if planned:
        values[f"planner-alone/{model}/mean"] = float(np.mean(planned))
    return values


def _figures(runs: Mapping[str, Sequence[RunSpec]], context: Context) -> tuple[Figure, ...]:
    curves = {
        preset: [
            Curve(label=spec.model, x=episodes[:, 0], y=episodes[:, 1])
            for spec in specs
            if spec.seed == 0 and len(episodes := context.ledger.episodes(spec))
        ]
        for preset, specs in runs.items()
    }
    kinds = (
        ("4.19", "Return of every episode", "Return of each training episode over the decisions of a run, seed 0.",
         lambda curve: curve),
        ("4.20", "Mean of the last ten episodes", "The same, each the mean of ten episodes, which shows who learns "
         "faster.", _smooth),
    )  # fmt: skip
    return tuple(
        Figure(
            number=number,
            title=title,
            says=says,
            panels=tuple(
                (f"preset {preset}", Curves(xlabel="decisions", ylabel="return", curves=tuple(map(change, drawn))))
                for preset, drawn in curves.items()
                if drawn
            ),
        )
        for number, title, says, change in kinds
        if any(curves.values())
    )


def _smooth(curve: Curve) -> Curve:
    return replace(curve, y=running_mean(curve.y))


def _numbers() -> tuple[Number, ...]:
    names = ("mean", "max", "min", "std")
    numbers = []
    for model, row in TABLE.items():
        numbers += [
            Number(
                id=f"table4.1/{model}/{name}",
                thesis=value,
                unit="return",
                better="near" if name == "std" else "higher",  # who loses every game never varies
            )
            for name, value in zip(names, row, strict=True)
        ]  # fmt: skip
        numbers += [
            Number(id=f"table4.1/{model}/{name}", thesis=None, unit="return") for name in ("iqm", "iqm-low", "iqm-high")
        ]
    return (
        *numbers,
        *(Number(id=f"planner-alone/{m}/mean", thesis=LOST, unit="return") for m in TABLE if MODELS[m].plans),
    )


def _by_preset(sweep: Sweep) -> dict[str, list[RunSpec]]:
    return {preset: [spec for spec in sweep.runs() if spec.preset == preset] for preset in sweep.seeds}


EXPERIMENT = Experiment(
    name="scores",
    place=4,
    title="Final results on Pong",
    section="§4.3",
    numbers=_numbers(),
    settings={scale: _by_preset(sweep) for scale, sweep in SWEEPS.items()},
    measure=measure,
    runs={scale: sweep.runs() for scale, sweep in SWEEPS.items()},
)
