"""Scores of the runs of a sweep: a row each, and their summary."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from semrl.core.errors import SemrlError
from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.evaluation.statistics import Floats, Profile, interquartile_mean, performance_profile
from semrl.sweep.rows import TRAINING, CellSummary, RunRow, Summary
from semrl.sweep.specification import Cell, Sweep
from semrl.sweep.task import Task
from semrl.training import RunFolder
from semrl.training.metrics import RUNNING_MEAN_EPISODES, read_metrics

THRESHOLDS = 101
"""At which a profile is drawn."""


def row_of(cell: Cell, task: Task) -> RunRow:
    """Sum a finished run up.

    Raises
    ------
    SemrlError
        When a file of it is damaged.
    """
    manifest = RunFolder.open(task.run).manifest()
    training = [float(row["return"]) for row in read_metrics(task.run / "metrics.csv") if row["policy"] == "agent"]
    try:
        tests = {
            trial.name: json.loads(trial.path(task.run).read_text(encoding="utf-8"))["returns"] for trial in task.trials
        }
        return RunRow(
            id=task.id,
            model=cell.model,
            game=cell.game,
            variant=cell.variant,
            seed=task.config.seed,
            decisions=manifest["result"]["decisions"],
            episodes=len(training),
            seconds=manifest["result"]["seconds"],
            worker=task.worker(),
            returns={TRAINING: training[-RUNNING_MEAN_EPISODES:], **tests},
            state=manifest["hashes"]["state"],
            weights=manifest["hashes"]["weights"],
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SemrlError(f"the results of {task.run} are damaged: {error!r}") from None


def write_rows(path: Path, rows: Sequence[RunRow]) -> None:
    """Write one JSON object a line."""
    write_text(path, "".join(f"{dumps(asdict(row))}\n" for row in rows))


def summed_up(sweep: Sweep, rows: Sequence[RunRow]) -> Summary:
    """Sum up the runs that are finished."""
    measure = sweep.policies[0] if sweep.episodes else TRAINING
    cells = [_cell(cell, measure, [row for row in rows if _is_of(row, cell)]) for cell in sweep.cells()]
    known = [cell for cell in cells if cell.means]
    profiles = {game: _profiles({game: [c for c in known if c.game == game]}) for game in sweep.games}
    if len(sweep.games) > 1 and all(game in sweep.reference for game in sweep.games):
        profiles["all games"] = _profiles(
            {game: [_as_shares(sweep, cell) for cell in known if cell.game == game] for game in sweep.games}
        )
    return Summary(measure=measure, cells=tuple(cells), profiles={k: v for k, v in profiles.items() if v})


def _is_of(row: RunRow, cell: Cell) -> bool:
    return (row.model, row.game, row.variant) == (cell.model, cell.game, cell.variant)


def _cell(cell: Cell, measure: str, rows: Sequence[RunRow]) -> CellSummary:
    returns = [np.array(row.returns[measure], float) for row in rows if row.returns.get(measure)]
    iqm, low, high = interquartile_mean(returns) if returns else (None, None, None)
    return CellSummary(
        game=cell.game,
        agent=cell.agent,
        runs=len(rows),
        iqm=iqm,
        low=low,
        high=high,
        means=tuple(float(run.mean()) for run in returns),
    )


def _as_shares(sweep: Sweep, cell: CellSummary) -> CellSummary:
    """Return a cell whose scores are shares between the references of its game."""
    reference = sweep.reference[cell.game]
    shares = tuple((mean - reference.low) / (reference.high - reference.low) for mean in cell.means)
    return CellSummary(**{**asdict(cell), "means": shares})


def _profiles(games: Mapping[str, Sequence[CellSummary]]) -> dict[str, Profile]:
    """Return the profile of each agent that has played all these games."""
    scores: dict[str, list[Floats]] = {}
    for cells in games.values():
        for cell in cells:
            scores.setdefault(cell.agent, []).append(np.array(cell.means))
    whole = {agent: played for agent, played in scores.items() if len(played) == len(games)}
    if not whole:
        return {}
    every = np.concatenate([game for played in whole.values() for game in played])
    thresholds = np.linspace(every.min() - 0.05 * (np.ptp(every) or 1), every.max(), THRESHOLDS)
    return {agent: performance_profile(played, thresholds) for agent, played in whole.items()}
