"""What a sweep trains, as a TOML file: models × games × variants of settings × seeds."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec

from semrl.core.errors import UsageError
from semrl.evaluation.player import Policy
from semrl.sweep.task import Task
from semrl.sweep.trials import Trial
from semrl.training import RunConfig, preset
from semrl.training.config import MODELS, merge, read_toml

AXES = {"model": "models", "env": "games", "seed": "seeds"}
"""Settings that are given by an axis of the file."""

USUAL = "usual"
"""Name of the one variant where the file has none."""


class Reference(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Scores of a game between which others are given, as shares: 0 at the low one, 1 at the high one."""

    low: float
    high: float


class Searched(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Values of a setting among which the best are searched: some choices, or a range.

    Attributes
    ----------
    choices
        Texts, numbers or truth values.
    low, high
        The ends of a range; of whole numbers where both are.
    log
        Whether what counts is by how many times two numbers differ.
    step
        Between the numbers of the range.
    """

    choices: tuple[str | int | float | bool, ...] = ()
    low: int | float | None = None
    high: int | float | None = None
    log: bool = False
    step: int | float | None = None

    def __post_init__(self) -> None:
        ranged = self.low is not None and self.high is not None
        if bool(self.choices) == ranged or (self.choices and (self.log or self.step)):
            raise UsageError("what is searched has choices, or low and high, and with these log or step")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise UsageError(f"low must lie below high, not {self.low} and {self.high}")
        if self.log and (self.step or (self.low or 0) <= 0):
            raise UsageError("with log, low lies above 0 and there is no step")
        if self.step is not None and self.step <= 0:
            raise UsageError(f"step must lie above 0, not {self.step}")

    @property
    def examples(self) -> tuple[Any, ...]:
        """Values that must all be allowed: the choices, or the ends."""
        return self.choices or (self.low, self.high)


class Search(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A search for the best settings.

    Attributes
    ----------
    settings
        Dotted name of each setting → among which values.
    trials
        How many are tried.
    objective
        ``return``: as high as can be, of the first policy, or of training where runs are not tested; ``seconds`` of
        training: as low as can be. Of several seeds it is the mean.
    seed
        Of the proposals.
    at_once
        Trials that are proposed together, before any of them has a value; they run side by side.
    random_trials
        Trials before the first that follows from others.
    """

    settings: dict[str, Searched]
    trials: int
    objective: Literal["return", "seconds"] = "return"
    seed: int = 0
    at_once: int = 1
    random_trials: int = 10

    def __post_init__(self) -> None:
        if not self.settings:
            raise UsageError("search.settings must name a setting")
        for name in ("trials", "at_once", "random_trials"):
            if getattr(self, name) < 1:
                raise UsageError(f"search.{name} must be 1 or more, not {getattr(self, name)}")
        if self.seed < 0:
            raise UsageError(f"search.seed must be 0 or more, not {self.seed}")


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
    search
        Where there is one, the variants are its trials, of one model in one game.
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
    search: Search | None = None

    def __post_init__(self) -> None:
        for name in ("models", "seeds", "games", "policies"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise UsageError(f"{name} must be named, each once, not {list(values)}")
        if self.episodes < 0:
            raise UsageError(f"episodes must be 0 or more, not {self.episodes}")
        for where, settings in {"settings": self.settings, **self.variants}.items():
            for name in AXES.keys() & settings.keys():
                raise UsageError(f"'{name}' in {where}: it is given by {AXES[name]} = […]")
        for name, reference in self.reference.items():
            if not reference.low < reference.high:
                raise UsageError(f"reference of {name}: low must lie below high")
        if self.search and (len(self.models), len(self.games)) != (1, 1):
            raise UsageError("a search is of one model in one game")
        if self.search and (wrong := AXES.keys() & self.search.settings.keys()):
            raise UsageError(f"'{min(wrong)}' cannot be searched: it is given by {AXES[min(wrong)]} = […]")

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
    if isinstance(search := values.get("search"), dict) and isinstance(search.get("settings"), dict):
        search["settings"] = flat(search["settings"])
    try:
        sweep = msgspec.convert(values, Sweep)
        for variant in sweep.variants:
            if not re.fullmatch(r"[\w.-]+", variant):
                raise UsageError(f"'{variant}' is no name of a variant: letters, digits, '-', '_' and '.' are")
        cells = sweep.cells()
        for cell in cells:
            sweep.tasks(cell, Path())  # what cannot be trained is refused before anything is
        if sweep.search:
            _check_search(sweep, sweep.search)
    except (msgspec.ValidationError, UsageError) as error:
        raise UsageError(f"{path}: {error}") from None
    if len({cell.id for cell in cells}) < len(cells):
        raise UsageError(f"{path}: two games or variants would be called alike: {', '.join(cell.id for cell in cells)}")
    return sweep


def flat(settings: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return what is searched by dotted names; in the file they may be nested."""
    found: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, dict) and not {"choices", "low", "high"} & value.keys():
            found |= flat(value, f"{before}{name}.")
        else:
            found[f"{before}{name}"] = value
    return found


def nested(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings with dotted names as nested tables."""
    whole: dict[str, Any] = {}
    for name, value in settings.items():
        *tables, key = name.split(".")
        one: dict[str, Any] = {key: value}
        for table in reversed(tables):
            one = {table: one}
        whole = merge(whole, one)
    return whole


def _check_search(sweep: Sweep, search: Search) -> None:
    """Refuse what cannot be trained before anything is; that values do not go together, only their trial shows."""
    if sweep.variants:
        raise UsageError("a search makes the variants itself; say which values in search.settings")
    (cell,) = sweep.cells()
    for name, searched in search.settings.items():
        for value in searched.examples:
            tried = msgspec.structs.replace(cell, settings=merge(cell.settings, nested({name: value})))
            sweep.tasks(tried, Path())
