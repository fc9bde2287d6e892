"""What came of the tests of a trained run."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semrl.sweep.trials import Trial, damaged


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a trial came to, as a row of ``trials.csv``.

    Attributes
    ----------
    id, decisions
        Of the run, and its budget.
    trial
        Its name.
    episodes, mean, max, min, std
        Games, and their returns.
    different
        Games of different lengths: a greedy agent may play one and the same game from several starts.
    """

    id: str
    decisions: int
    trial: str
    episodes: int
    mean: float
    max: float
    min: float
    std: float
    different: int


def outcome_of(trial: Trial, run: Path, *, id_: str, decisions: int) -> Outcome:
    """Sum up a trial that was held.

    Raises
    ------
    SemrlError
        When its file is damaged.
    """
    path = trial.path(run)
    try:
        stored: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        numbers = {name: stored[name] for name in ("episodes", "mean", "max", "min", "std")}
        return Outcome(id=id_, decisions=decisions, trial=trial.name, different=len(set(stored["lengths"])), **numbers)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise damaged(path, error) from None
