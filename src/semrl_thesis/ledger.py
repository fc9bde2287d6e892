"""The ledger of finished runs: a row for each in ``runs.csv``, for each of its trials in ``trials.csv``, and its
training episodes in ``returns/ID.csv``.

What stands here is done, even when the folder of the run is gone.
"""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from semrl.core.errors import SemrlError
from semrl.core.files import make_folder, write_text
from semrl.core.strict_json import dumps
from semrl.sweep import Trial
from semrl.training import RunConfig, RunFolder
from semrl.training.config import to_dict
from semrl.training.metrics import RUNNING_MEAN_EPISODES, read_metrics
from semrl_thesis.results import digest
from semrl_thesis.sweep import RunSpec
from semrl_thesis.trials import Outcome, outcome_of

RUNS, TRIALS = "runs.csv", "trials.csv"


@dataclass(frozen=True, kw_only=True)
class Score:
    """A finished run, as a row of ``runs.csv``; numbers are None where no episode was finished or nothing planned.

    Attributes
    ----------
    id, preset, model, seed, decisions
        See `RunSpec`.
    mean, max, min, std
        Returns of the last ten training episodes; the standard deviation is that of a sample, as the thesis's is.
    planner
        Mean return of the planner alone.
    seconds
        Wall-clock time of the training.
    versions, machine
        What it ran on.
    weights
        Digest of what was learned.
    settings
        See `settings_of`.
    """

    id: str
    preset: str
    model: str
    seed: int
    decisions: int
    episodes: int
    mean: float | None
    max: float | None
    min: float | None
    std: float | None
    planner: float | None
    seconds: float
    versions: str
    machine: str
    weights: str
    settings: str


Key = tuple[str, int, str]
"""Id, budget in decisions and settings of a run."""

Row = TypeVar("Row", Score, Outcome)


@dataclass(frozen=True, kw_only=True)
class Ledger:
    """All that is known of finished runs.

    Attributes
    ----------
    scores
        By run.
    returns
        By run: ``(episodes, 2)``, decisions at the end of each training episode and its return.
    outcomes
        By run and name of the trial.
    """

    scores: Mapping[Key, Score]
    returns: Mapping[Key, NDArray[np.float64]]
    outcomes: Mapping[tuple[Key, str], Outcome]

    def score(self, spec: RunSpec) -> Score | None:
        """Return what a run has scored; None while it is not finished, or was with other settings."""
        return self.scores.get(_key(spec))

    def outcome(self, spec: RunSpec, trial: Trial) -> Outcome | None:
        """Return what a trial of a run came to; None while it was not held."""
        return self.outcomes.get((_key(spec), trial.name))

    def is_done(self, spec: RunSpec) -> bool:
        """Whether a run is finished with these settings, and all its trials were held."""
        return self.score(spec) is not None and all(self.outcome(spec, trial) for trial in spec.trials)

    def last_returns(self, spec: RunSpec) -> NDArray[np.float64]:
        """Return the returns of the last episodes, ``(≤ 10,)``."""
        episodes = self.episodes(spec)
        return episodes[-RUNNING_MEAN_EPISODES:, 1]

    def episodes(self, spec: RunSpec) -> NDArray[np.float64]:
        """Return decisions and returns of all training episodes, ``(n, 2)``."""
        return self.returns.get(_key(spec), np.zeros((0, 2)))


def settings_of(config: RunConfig) -> str:
    """Return a digest of what a run does otherwise than by default, but for what changes nothing that is learned.

    A setting that is new, and off by default, leaves it as it was.
    """
    ours, default = to_dict(config), to_dict(RunConfig())
    what = {name: value for name, value in _changes(ours, default).items() if name not in _CHANGE_NOTHING}
    return digest(dumps(what, sort_keys=True))


_CHANGE_NOTHING = ("threads", "checkpoint_seconds", "milestones", "evaluation")


def _changes(ours: Mapping[str, Any], default: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _changes(value, default[name]) if isinstance(value, Mapping) else value
        for name, value in ours.items()
        if value != default[name]
    }


def _key(spec: RunSpec) -> Key:
    return spec.id, spec.decisions, settings_of(spec.config())


def read_ledger(folders: Iterable[Path]) -> Ledger:
    """Read the ledgers of some folders; of a run that stands in several, the first counts.

    Raises
    ------
    SemrlError
        When a file is damaged.
    """
    scores: dict[Key, Score] = {}
    returns: dict[Key, NDArray[np.float64]] = {}
    outcomes: dict[tuple[Key, str], Outcome] = {}
    for folder in folders:
        held = read_table(folder / TRIALS, Outcome)
        for score in read_table(folder / RUNS, Score):
            key = (score.id, score.decisions, score.settings)
            if key not in scores:
                scores[key] = score
                returns[key] = _read_returns(folder / "returns" / f"{score.id}.csv")
                its = (outcome for outcome in held if (outcome.id, outcome.decisions) == key[:2])
                outcomes |= {(key, outcome.trial): outcome for outcome in its}
    return Ledger(scores=scores, returns=returns, outcomes=outcomes)


def read_table(path: Path, kind: type[Row]) -> list[Row]:
    """Read ``runs.csv`` or ``trials.csv``; nothing where there is none.

    Raises
    ------
    SemrlError
        When it is damaged.
    """
    if not path.exists():
        return []
    columns = tuple(field.name for field in fields(kind))
    try:
        text = path.read_text(encoding="utf-8")
        table = csv.DictReader(text.splitlines())
        if tuple(table.fieldnames or ()) != columns:
            raise ValueError(f"it does not have the columns {', '.join(columns)}")
        if not text.endswith("\n"):
            raise ValueError("its last line is not whole")
        return [_row(line, kind) for line in table]
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise SemrlError(f"{path} is damaged: {error}") from None


def enter(folder: Path, score: Score, episodes: NDArray[np.float64], outcomes: Sequence[Outcome] = ()) -> None:
    """Write a finished run into the ledger of a folder; its row comes last, and says that all is there."""
    make_folder(folder / "returns")
    lines = [f"{decisions:.0f},{total:g}\n" for decisions, total in episodes]
    write_text(folder / "returns" / f"{score.id}.csv", "decisions,return\n" + "".join(lines))
    _replace(folder / TRIALS, score.id, outcomes)
    _replace(folder / RUNS, score.id, [score])


def score_of(spec: RunSpec, run: Path) -> tuple[Score, NDArray[np.float64], list[Outcome]]:
    """Sum a finished run up: its row, its episodes and its trials."""
    outcomes = [outcome_of(trial, run, id_=spec.id, decisions=spec.decisions) for trial in spec.trials]
    manifest = RunFolder.open(run).manifest()
    rows = [row for row in read_metrics(run / "metrics.csv") if row["policy"] == "agent"]
    episodes = np.array([(float(row["decisions"]), float(row["return"])) for row in rows]).reshape(-1, 2)
    last = episodes[-RUNNING_MEAN_EPISODES:, 1]
    score = Score(
        id=spec.id,
        preset=spec.preset,
        model=spec.model,
        seed=spec.seed,
        decisions=spec.decisions,
        episodes=len(episodes),
        **summed_up(last),
        planner=next((outcome.mean for outcome in outcomes if outcome.trial == "planner"), None),
        seconds=manifest["result"]["seconds"],
        versions=" ".join(f"{name}={value}" for name, value in manifest["versions"].items()),
        machine=" ".join(str(value) for value in manifest["machine"].values()),
        weights=manifest["hashes"]["weights"][:16],
        settings=settings_of(RunFolder.open(run).config()),
    )
    return score, episodes, outcomes


def summed_up(returns: NDArray[np.float64]) -> dict[str, float | None]:
    """Return mean, max, min and standard deviation of a sample, as Table 4.1 has them."""
    if not len(returns):
        return dict.fromkeys(("mean", "max", "min", "std"))
    ends = {"max": float(returns.max()), "min": float(returns.min())}
    return {"mean": float(returns.mean()), **ends, "std": deviation(returns)}


def deviation(returns: NDArray[np.float64]) -> float:
    """Return the standard deviation of a sample; 0 of a single game."""
    return float(returns.std(ddof=1)) if len(returns) > 1 else 0.0


def _row(line: Mapping[str, str], kind: type[Row]) -> Row:
    """Read the cells of a row as what its fields are."""
    read: dict[Any, Callable[[str], Any]] = {
        int: int,
        float: float,
        str: str,
        float | None: lambda cell: float(cell) if cell else None,
    }
    return kind(**{field.name: read[field.type](line[field.name]) for field in fields(kind)})


def _replace(path: Path, id_: str, rows: Sequence[Row]) -> None:
    """Write the rows of a run in place of those that stand in a table."""
    if not rows:
        return
    kind: type[Row] = type(rows[0])
    kept: list[Row] = [row for row in read_table(path, kind) if row.id != id_]
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(kind)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in [*kept, *rows])
    write_text(path, text.getvalue())


def _read_returns(path: Path) -> NDArray[np.float64]:
    if not path.exists():
        return np.zeros((0, 2))
    try:
        lines = path.read_text(encoding="utf-8").splitlines()[1:]
        return np.array([[float(cell) for cell in line.split(",")] for line in lines]).reshape(-1, 2)
    except (OSError, ValueError) as error:
        raise SemrlError(f"{path} is damaged: {error}") from None
