"""What a sweep trains, as a TOML file: models × games × variants of settings × seeds."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from semrl.core.errors import UsageError
from semrl.evaluation.player import Policy
from semrl.sweep.task import Task
from semrl.sweep.trials import Trial
from semrl.training import RunConfig, preset
from semrl.training.config import MODELS, merge, read_toml

AXES = {"model": "models", "env": "games", "seed": "seeds"}
"""Settings that are told by an axis of the file."""

USUAL = "usual"
"""Name of the one variant where the file has none."""


class Reference(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Scores of a game between which others are told, as shares: 0 at the low one, 1 at the high one."""

    low: float
    high: float


class Sweep(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Runs of a sweep, as its file says them.

    Attributes
    ----------
    models, games, seeds
        Every one with every other one.
    preset
        Of all runs.
    settings
        Nested settings of all runs, on top of the preset; those under ``models.NAME`` for one model.
    variants
        Name → nested settings on top of these: one more axis.
    episodes
        Games of each test after training; 0: runs are not tested, and the last training episodes count.
    policies
        Who plays them; the planner only where there is one. The first one decides the scores of the summary.
    reference
        Game → its low and high score; with one for each game, scores of several games are summed up together.
    """

    models: tuple[str, ...]
    seeds: tuple[int, ...]
    games: tuple[str, ...] = (RunConfig.env,)
    preset: str = "semrl"
    settings: dict[str, Any] = {}
    variants: dict[str, dict[str, Any]] = {}
    episodes: int = 10
    policies: tuple[Policy, ...] = ("agent",)
    reference: dict[str, Reference] = {}

    def __post_init__(self) -> None:
        for name in ("models", "seeds", "games", "policies"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise UsageError(f"{name} must be named, each once, not {list(values)}")
        if self.episodes < 0:
            raise UsageError(f"episodes must be 0 or more, not {self.episodes}")
        for where, settings in {"settings": self.settings, **self.variants}.items():
            for name in AXES.keys() & settings.keys():
                raise UsageError(f"'{name}' in {where}: it is told by {AXES[name]} = […]")
        for name, reference in self.reference.items():
            if not reference.low < reference.high:
                raise UsageError(f"reference of {name}: low must lie below high")

    def cells(self) -> list["Cell"]:
        """Return all that runs differ in but for their seeds."""
        variants: Mapping[str, Mapping[str, Any]] = self.variants or {USUAL: {}}
        return [
            Cell(model=model, game=game, variant=variant, settings=merge(self.settings, settings))
            for game in self.games
            for model in self.models
            for variant, settings in variants.items()
        ]

    def tasks(self, cell: "Cell", folder: Path) -> list[Task]:
        """Return the runs of a cell, in a folder.

        Raises
        ------
        UsageError
            When a setting is unknown or wrong.
        """
        policies = [policy for policy in self.policies if policy == "agent" or MODELS[cell.model].plans]
        trials = tuple(Trial(policy=policy, episodes=self.episodes) for policy in policies) if self.episodes else ()
        ids = {seed: f"{cell.id}-{seed}" for seed in self.seeds}
        return [
            Task(id=id_, run=folder / "runs" / id_, config=self._config(cell, seed), trials=trials)
            for seed, id_ in ids.items()
        ]

    def _config(self, cell: "Cell", seed: int) -> RunConfig:
        return preset(self.preset, cell.model, {**cell.settings, "env": cell.game, "seed": seed})


class Cell(msgspec.Struct, frozen=True, kw_only=True):
    """Runs that differ in their seed alone."""

    model: str
    game: str
    variant: str
    settings: dict[str, Any]

    @property
    def id(self) -> str:
        """What its runs are called, before their seed."""
        game = re.sub(r"[^\w.-]+", "-", self.game.partition("NoFrameskip")[0]).lower()
        return "-".join([self.model, game, *([self.variant] if self.variant != USUAL else [])])

    @property
    def agent(self) -> str:
        """What is compared with others in one game: the model, and the variant where there are any."""
        return self.model if self.variant == USUAL else f"{self.model} {self.variant}"


def read_sweep(path: Path) -> Sweep:
    """Read the file of a sweep.

    Raises
    ------
    UsageError
        When it is missing, or anything in it is unknown or wrong; the message names the file.
    """
    values = read_toml(path)
    try:
        sweep = msgspec.convert(values, Sweep)
        for variant in sweep.variants:
            if not re.fullmatch(r"[\w.-]+", variant):
                raise UsageError(f"'{variant}' is no name of a variant: letters, digits, '-', '_' and '.' are")
        cells = sweep.cells()
        for cell in cells:
            sweep.tasks(cell, Path())  # what cannot be trained is told before anything is
    except (msgspec.ValidationError, UsageError) as error:
        raise UsageError(f"{path}: {error}") from None
    if len({cell.id for cell in cells}) < len(cells):
        raise UsageError(f"{path}: two games or variants would be called alike: {', '.join(cell.id for cell in cells)}")
    return sweep
