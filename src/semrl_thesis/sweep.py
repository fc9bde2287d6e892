"""The training runs behind Table 4.1 and other comparisons, as data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from semrl.sweep import Trial
from semrl.training import RunConfig, preset
from semrl.training.config import MODELS, merge

CHEAPEST = ("ram", "objects", "semantic", "ram-map", "objects-map", "semantic-map", "otsu", "baseline", "birch")
"""Models, those whose decisions take least time first."""

PIXELS = ("grey", "components", "classes")
"""Encoders whose states are images."""


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """One training run.

    Attributes
    ----------
    preset, model, seed, decisions
        As `semrl train` has them.
    overrides
        Nested settings on top of the preset.
    trials
        How it is tested after training.
    variant
        Tells it from other runs of this preset, model and seed.
    """

    preset: str
    model: str
    seed: int
    decisions: int
    overrides: Mapping[str, Any] = field(default_factory=dict)
    trials: tuple[Trial, ...] = ()
    variant: str = ""

    @property
    def id(self) -> str:
        """What it is called."""
        return "-".join(part for part in (self.preset, self.model, str(self.seed), self.variant) if part)

    def config(self) -> RunConfig:
        """Return the configuration of the run."""
        return preset(self.preset, self.model, {**self.overrides, "decisions": self.decisions, "seed": self.seed})


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Runs of several models: for each preset the seeds of models that see images, and of the others.

    Attributes
    ----------
    decisions
        Budget of the runs of each preset.
    seeds
        Preset → seeds of pixel models and seeds of the others.
    models
        Which.
    overrides
        Nested settings, for every run; those under ``models.NAME`` for one model.
    presets
        The same for the runs of one preset: name → nested settings.
    planner_episodes
        Episodes that the planner plays alone after training, where there is a map.
    """

    decisions: Mapping[str, int]
    seeds: Mapping[str, tuple[tuple[int, ...], tuple[int, ...]]]
    models: tuple[str, ...]
    overrides: Mapping[str, Any] = field(default_factory=dict)
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    planner_episodes: int = 5

    def runs(self) -> tuple[RunSpec, ...]:
        """Return all runs, preset by preset, model by model."""
        return tuple(
            RunSpec(
                preset=name,
                model=model,
                seed=seed,
                decisions=self.decisions[name],
                overrides=merge(self.overrides, self.presets.get(name, {})),
                trials=(Trial(policy="planner", episodes=self.planner_episodes),) if MODELS[model].plans else (),
            )
            for name, (pixels, others) in self.seeds.items()
            for model in self.models
            for seed in (pixels if MODELS[model].encoder in PIXELS else others)
        )


def cheapest_first(specs: Sequence[RunSpec]) -> list[RunSpec]:
    """Sort runs by the time they take; of equal ones first seeds come first."""
    return sorted(specs, key=lambda spec: (CHEAPEST.index(spec.model), spec.seed))
