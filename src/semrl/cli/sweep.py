"""``semrl sweep``: many runs side by side, on this machine or on many, and their scores."""

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import tyro
from msgspec import to_builtins
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from semrl.cli.arguments import parse
from semrl.cli.progress import console, error_console, say
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import make_folder
from semrl.core.strict_json import dumps
from semrl.report.sweep import write_sweep
from semrl.report.wording import interval
from semrl.sweep.engine import Pool, TaskState, run_all
from semrl.sweep.local import LocalPool
from semrl.sweep.rows import RunRow, Summary
from semrl.sweep.scores import row_of, summed_up, write_rows
from semrl.sweep.search import best_of, propose, read_proposals, valued, with_trials, write_proposals
from semrl.sweep.specification import Search, Sweep, read_sweep
from semrl.sweep.task import Task

SHOWN_RUNS = 40
"""Lines of the live table: those that run and fail, and the next ones."""


@dataclass(frozen=True, kw_only=True)
class SweepArguments:
    """Train and test many runs, as a TOML file says: models × games × variants of settings × seeds.

    A run that loses its worker goes on elsewhere from its newest checkpoint, and ends as if nothing had happened. So
    does the whole: the same command goes on where it was stopped, and trains what was added to the file meanwhile.
    With a [search] it looks for the best settings, trial after trial (extra 'optuna').

    Example:  semrl sweep many.toml --workers 4
    """

    file: tyro.conf.Positional[Path]
    """TOML file with models, seeds, and if wanted games, preset, settings, variants, episodes, policies, reference,
    search."""
    out: Path | None = None
    """Folder of the runs, rows.jsonl and the page [default: runs/FILE]; every worker must reach it."""
    engine: Literal["local", "ray"] = "local"
    """Processes on this machine, or Ray (extra 'ray')."""
    workers: int | None = None
    """Runs side by side on this machine [default: one for each processor]."""
    address: str | None = None
    """Of the Ray cluster, such as 10.0.0.1:6379 or auto [default: one is begun on this machine]."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, train, sum up, print."""
    arguments = parse(SweepArguments, argv, command="sweep")
    sweep = read_sweep(arguments.file)
    out = arguments.out or Path("runs") / arguments.file.stem
    if sweep.search:
        sweep, rows, states = _search(arguments, sweep, sweep.search, out)
    else:
        rows, states = _train(arguments, sweep, out)
    summary = summed_up(sweep, rows)
    failed = {state.task.id: state.problem for state in states if state.status == "failed"}
    page = write_sweep(summary, rows, failed, out / "report.html", title=arguments.file.stem)
    proposals = read_proposals(out) if sweep.search else []
    best = best_of(sweep.search, proposals) if sweep.search else None
    if failed and best is None:  # of a search, trials may fail: values need not go together
        name, problem = next(iter(failed.items()))
        raise SemrlError(f"{len(failed)} of {len(states)} runs failed, the first of them {name}: {problem}; see {page}")
    if arguments.json:
        found = {"measure": summary.measure, "cells": [asdict(cell) for cell in summary.cells]}
        searched = {"best": to_builtins(best), "trials": to_builtins(proposals)} if best else {}
        result = {"out": str(out), "page": str(page), **found, "rows": [asdict(row) for row in rows]}
        print(dumps(result | searched))
        return
    console.print(_table(summary))
    if best:
        settings = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in best.settings.items())
        console.print(Text(f"best: {best.variant}, {best.value:.4g}: {settings}"), soft_wrap=True)
    console.print(f"page: {page.resolve().as_uri()}", soft_wrap=True)


def _train(arguments: SweepArguments, sweep: Sweep, out: Path) -> tuple[list[RunRow], list[TaskState]]:
    """Train and test all runs of a sweep that are not done yet; return the rows of all, and how the tasks stand."""
    cells = {task.id: (cell, task) for cell in sweep.cells() for task in sweep.tasks(cell, out)}
    rows: dict[str, RunRow] = {}

    def on_finished(task: Task) -> None:
        rows[task.id] = row_of(*cells[task.id])
        write_rows(out / "rows.jsonl", in_order())

    def in_order() -> list[RunRow]:
        return [rows[id_] for id_ in cells if id_ in rows]

    tasks, pool = [task for _, task in cells.values()], _pool(arguments)
    with _shown() as (say, show):
        states = run_all(tasks, pool, out, say=say, show=show, on_finished=on_finished)
    return in_order(), states


def _search(
    arguments: SweepArguments, sweep: Sweep, search: Search, out: Path
) -> tuple[Sweep, list[RunRow], list[TaskState]]:
    """Train trial after trial, some at once; return the sweep that they make, its rows, and how its tasks stand."""
    make_folder(out)
    proposals = read_proposals(out)
    ended: dict[str, TaskState] = {}
    while True:
        if not any(one.is_open for one in proposals) and len(proposals) < search.trials:
            proposals += propose(search, proposals)
            write_proposals(out, proposals)  # before they are trained: who goes on trains these
        whole = with_trials(sweep, [one for one in proposals if not one.failed])
        rows, states = _train(arguments, whole, out)
        ended |= {state.task.id: state for state in states}
        measure = summed_up(whole, rows).measure
        open_ = [one for one in proposals if one.is_open]
        proposals = [valued(search, one, rows, measure, len(sweep.seeds)) if one in open_ else one for one in proposals]
        write_proposals(out, proposals)
        for one in proposals:
            if any(one.number == before.number for before in open_):
                say(f"{one.variant}: {'failed' if one.value is None else f'{search.objective} {one.value:.4g}'}")
        if len(proposals) >= search.trials:
            return with_trials(sweep, proposals), rows, list(ended.values())


def _pool(arguments: SweepArguments) -> Pool:
    if arguments.workers is not None and arguments.workers < 1:
        raise UsageError(f"--workers must be 1 or more, not {arguments.workers}")
    if arguments.engine == "local":
        if arguments.address is not None:
            raise UsageError("--address is that of a Ray cluster; it needs --engine ray")
        return LocalPool(arguments.workers or os.cpu_count() or 1)
    from semrl.sweep.on_ray import RayPool

    if arguments.address is not None and arguments.workers is not None:
        raise UsageError("--workers is for this machine; a cluster with an --address has its own")
    return RayPool(arguments.address, workers=arguments.workers)


@contextlib.contextmanager
def _shown() -> Iterator[tuple[Callable[[str], None], Callable[[Sequence[TaskState]], None] | None]]:
    """Show a table that lives, or lines where there is no terminal."""
    if not error_console.is_terminal:
        yield say, None
        return
    with Live(console=error_console, refresh_per_second=4, transient=True) as live:
        yield live.console.print, lambda states: live.update(state_table(states))


def state_table(states: Sequence[TaskState]) -> Group:
    """Lay out what runs where."""
    counts = {status: sum(state.status == status for state in states) for status in ("finished", "failed")}
    table = Table("run", "on", "lost", "how far", box=None, padding=(0, 2, 0, 0))
    shown = [state for state in states if state.status != "finished"]
    for state in sorted(shown, key=lambda state: state.status == "waiting")[:SHOWN_RUNS]:
        worker = state.task.worker() if state.status == "running" else ""
        said = {"running": state.task.last_line() if worker else "waits for a place", "failed": state.problem}
        cells = (state.task.id, worker, str(state.losses or ""), said.get(state.status, state.status))
        table.add_row(*map(Text, cells))
    head = f"{counts['finished']} of {len(states)} runs finished"
    return Group(Text(head + (f", {counts['failed']} failed" if counts["failed"] else "")), table)


def _table(summary: Summary) -> Table:
    """Lay the scores out."""
    table = Table("game", "agent", "runs", "interquartile mean", "95 % interval", box=None, padding=(0, 2, 0, 0))
    for cell in summary.cells:
        mean, ends = interval(cell.iqm, cell.low, cell.high)
        table.add_row(*map(Text, (cell.game, cell.agent, str(cell.runs), mean, ends)))
    return table
