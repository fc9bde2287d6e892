"""Reproducing the thesis's evaluation: which experiments there are, what is done, what is still to do."""

import difflib
import fnmatch
import importlib
import importlib.resources
import importlib.util
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import semrl
import semrl_thesis
from semrl.core.errors import UsageError
from semrl.core.files import make_folder
from semrl.training.session import limited_threads
from semrl_thesis.base import Context, Experiment, Scale
from semrl_thesis.ledger import read_ledger
from semrl_thesis.queue import train_all
from semrl_thesis.results import Result, Row, Section, digest, read_result, rows_of, write_result, write_rows
from semrl_thesis.sweep import RunSpec, cheapest_first

SHIPPED = Path(str(importlib.resources.files("semrl_thesis") / "shipped"))
"""Results that come with this package: what stands there need not be measured again."""

EXTRAS = {"thesis": "gensim", "sb3": "stable_baselines3"}
"""What tells whether an extra is installed."""

SHIPPED_SCALE: Scale = "full"
"""Their scale."""


@dataclass(frozen=True, kw_only=True)
class Order:
    """How much to train, and in which order.

    Attributes
    ----------
    workers
        Runs side by side; 0: none, only what is there is summed up.
    order
        Cheapest first, or as Table 4.1 lists them, preset after preset.
    only
        Patterns such as ``semrl-ram*``: of the runs only those that match one of them; empty: all.
    afresh
        Leave out of account what comes with this package.
    """

    workers: int = 2
    order: Literal["cheapest", "listed"] = "cheapest"
    only: tuple[str, ...] = ()
    afresh: bool = False


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """What came of it: a section for every experiment that something is known of, and runs that failed."""

    sections: tuple[Section, ...]
    rows: tuple[Row, ...]
    failures: dict[str, str]


@cache
def discover() -> dict[str, Experiment]:
    """Return all experiments by name: every module of this package that has an ``EXPERIMENT``."""
    modules = [importlib.import_module(f"{semrl_thesis.__name__}.{module.name}")
               for module in pkgutil.iter_modules(semrl_thesis.__path__)]  # fmt: skip
    found = [module.EXPERIMENT for module in modules if hasattr(module, "EXPERIMENT")]
    return {experiment.name: experiment for experiment in sorted(found, key=lambda e: e.place)}


def reproduce(
    names: Sequence[str],
    *,
    scale: Scale,
    out: Path,
    order: Order | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Reproduction:
    """Measure what was not measured yet, and put it beside the thesis's.

    Parameters
    ----------
    names
        Of experiments; none: all.
    scale
        Budget.
    out
        Folder of results and runs; it is made. What is there already counts.
    order
        Of the training runs.
    say
        Is told what is being done.

    Raises
    ------
    UsageError
        When an experiment or a pattern is unknown, or the folder cannot be used.
    SemrlError
        When a file is damaged, or it was stopped by SIGINT or SIGTERM.
    """  # fmt: skip
    order = order or Order()
    chosen = _chosen(names)
    specs = _wanted(chosen, scale, order)
    make_folder(out)
    shipped = (SHIPPED,) if scale == SHIPPED_SCALE and not order.afresh else ()
    context = Context(scale=scale, folder=out, ledger=read_ledger((out, *shipped)), shipped=shipped, say=say)
    _report_known(context, specs)
    with limited_threads(1):
        for experiment in chosen:
            if not experiment.runs:
                _result(experiment, context)
        failures = train_all(specs, out, context.ledger, workers=order.workers, say=say) if order.workers else {}
        context = replace(context, ledger=read_ledger(context.folders))
        for experiment in chosen:
            if experiment.runs:
                _result(experiment, context)
    sections = _sections(context)
    write_rows(out / "results.csv", [row for section in sections for row in section.rows])
    named = {experiment.name for experiment in chosen}
    rows = tuple(row for section in sections if section.name in named for row in section.rows)
    return Reproduction(sections=sections, rows=rows, failures=failures)


def _report_known(context: Context, specs: Sequence[RunSpec]) -> None:
    """Say how many runs need not be trained because they were before, on another machine."""
    own = read_ledger((context.folder,))
    known = [spec for spec in specs if context.ledger.is_done(spec) and not own.is_done(spec)]
    if known:
        context.say(f"{len(known)} of {len(specs)} runs are known from {SHIPPED}; --afresh trains them again")


def _chosen(names: Sequence[str]) -> list[Experiment]:
    known = discover()
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean '{close[0]}'?" if close else f"; there are {', '.join(known)}"
            raise UsageError(f"unknown experiment '{name}'{hint}")
    return [experiment for name, experiment in known.items() if not names or name in names]


def _wanted(chosen: Sequence[Experiment], scale: Scale, order: Order) -> list[RunSpec]:
    """Return the runs to be trained, in their order, each once."""
    specs = {spec.id: spec for experiment in chosen for spec in experiment.runs.get(scale, ())}
    for pattern in order.only:
        if not fnmatch.filter(specs, pattern):
            raise UsageError(
                f"no run matches '{pattern}'; there are {', '.join(specs) or 'none for these experiments'}"
            )
    wanted = [spec for id_, spec in specs.items() if not order.only or any(fnmatch.fnmatch(id_, p) for p in order.only)]
    return cheapest_first(wanted) if order.order == "cheapest" else wanted


def _result(experiment: Experiment, context: Context) -> None:
    """Measure an experiment, if that was not done yet with these settings and runs."""
    settings = _fingerprint(experiment, context)
    if _kept(experiment, context.folders, settings) is None:
        write_result(
            context.folder / f"{experiment.name}.npz",
            experiment.measure(experiment.settings[context.scale], context),
            settings,
        )


def _kept(experiment: Experiment, folders: Sequence[Path], settings: str | None = None) -> Result | None:
    """Return the result that lies in one of the folders, measured with these settings and all that is installed now.

    Without settings: whichever.
    """
    for path in (folder / f"{experiment.name}.npz" for folder in folders):
        result = read_result(path, settings) if path.exists() else None
        if result and (settings is None or (result.whole and not any(map(_is_installed, result.lacks)))):
            return result
    return None


def _is_installed(extra: str) -> bool:
    return importlib.util.find_spec(EXTRAS[extra]) is not None


def _fingerprint(experiment: Experiment, context: Context) -> str:
    """Tell settings and runs apart in a few characters."""
    known = [
        (context.ledger.score(spec), [context.ledger.outcome(spec, trial) for trial in spec.trials])
        for spec in experiment.runs.get(context.scale, ())
    ]
    return digest(semrl.__version__, context.scale, experiment.settings[context.scale], experiment.numbers, known)


def _sections(context: Context) -> tuple[Section, ...]:
    """Return what is known of every experiment, measured now or before."""
    sections = []
    for experiment in discover().values():
        result = _kept(experiment, context.folders, _fingerprint(experiment, context)) or _kept(
            experiment, context.folders
        )
        if result:
            sections.append(
                Section(
                    name=experiment.name,
                    title=experiment.title,
                    place=experiment.section,
                    command=f"semrl reproduce {experiment.name} --scale {context.scale}",
                    rows=tuple(rows_of(experiment.numbers, result.values)),
                    figures=result.figures,
                    notes=result.notes,
                )
            )
    return tuple(sections)
