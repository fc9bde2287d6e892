"""A search for the best settings: trials that Optuna (extra ``optuna``) proposes, each a variant of a sweep."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from semrl.core.errors import MissingExtraError, SemrlError, UsageError
from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.sweep.rows import RunRow
from semrl.sweep.specification import Search, Searched, Sweep, nested

LOG = "search.jsonl"
"""File in a sweep's folder: a line for each trial, in the order in which they were proposed."""


class Proposal(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One trial of a search.

    Attributes
    ----------
    number
        From 0.
    settings
        Dotted name of each setting that is searched → its value.
    value
        Of the objective; None while it is not known.
    failed
        Whether a run of it has failed, so that there will be no value.
    """

    number: int
    settings: dict[str, Any]
    value: float | None = None
    failed: bool = False

    @property
    def variant(self) -> str:
        """What it is called among the variants of the sweep."""
        return f"trial-{self.number:03}"

    @property
    def is_open(self) -> bool:
        """Whether it still has to be trained."""
        return self.value is None and not self.failed


def with_trials(sweep: Sweep, proposals: Sequence[Proposal]) -> Sweep:
    """Return a sweep whose variants are these trials."""
    variants = {one.variant: nested(one.settings) for one in proposals}
    return msgspec.structs.replace(sweep, variants=variants)


def read_proposals(folder: Path) -> list[Proposal]:
    """Read the trials that were proposed so far; none where there is no log.

    Raises
    ------
    SemrlError
        When the log is damaged.
    """
    try:
        lines = (folder / LOG).read_text(encoding="utf-8").splitlines()
        return [msgspec.json.decode(line, type=Proposal) for line in lines]
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as error:
        raise SemrlError(f"{folder / LOG} is damaged: {error}") from None


def write_proposals(folder: Path, proposals: Sequence[Proposal]) -> None:
    """Write all trials, whole or not at all."""
    write_text(folder / LOG, "".join(f"{dumps(msgspec.to_builtins(one))}\n" for one in proposals))


def propose(search: Search, known: Sequence[Proposal]) -> list[Proposal]:
    """Return the next trials, `Search.at_once` at most, given all earlier ones.

    They follow from the search and these trials alone, so that a search that was stopped goes on as if it had not been.

    Raises
    ------
    MissingExtraError
        When Optuna is not installed.
    UsageError
        When the earlier trials are of another search.
    """
    try:
        import optuna
    except ImportError:
        raise MissingExtraError("optuna", "a [search]") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    space = {name: _distribution(searched) for name, searched in search.settings.items()}
    sampler = optuna.samplers.TPESampler(
        seed=int(np.random.SeedSequence([search.seed, len(known)]).generate_state(1)[0]),
        n_startup_trials=search.random_trials,
        constant_liar=True,
        multivariate=True,
    )
    highest = search.objective == "return"
    study = optuna.create_study(sampler=sampler, direction="maximize" if highest else "minimize")
    for one in known:
        if one.settings.keys() != space.keys():
            raise UsageError(f"{LOG} is of a search for other settings; delete it to begin again")
        state = optuna.trial.TrialState.COMPLETE if one.value is not None else optuna.trial.TrialState.FAIL
        try:
            study.add_trial(
                optuna.trial.create_trial(params=one.settings, distributions=space, value=one.value, state=state)
            )
        except ValueError as error:
            raise UsageError(f"{LOG} is of a search in other ranges ({error}); delete it to begin again") from None
    fresh = min(search.at_once, search.trials - len(known))
    asked = [study.ask(space) for _ in range(fresh)]
    return [Proposal(number=len(known) + i, settings=dict(trial.params)) for i, trial in enumerate(asked)]


def valued(search: Search, proposal: Proposal, rows: Sequence[RunRow], measure: str, runs: int) -> Proposal:
    """Return a trial with what its finished runs came to: the mean over its seeds; failed, where one is missing."""
    own = [row for row in rows if row.variant == proposal.variant]
    values = [row.seconds if search.objective == "seconds" else _mean(row.returns.get(measure, ())) for row in own]
    if len(own) < runs or any(value is None for value in values):
        return msgspec.structs.replace(proposal, failed=True)
    return msgspec.structs.replace(proposal, value=float(np.mean([value for value in values if value is not None])))


def best_of(search: Search, proposals: Sequence[Proposal]) -> Proposal | None:
    """Return the best trial, of equal ones the first; None where none has a value."""
    sign = -1 if search.objective == "return" else 1
    known = [(sign * one.value, one.number, one) for one in proposals if one.value is not None]
    return min(known, key=lambda each: each[:2])[2] if known else None


def _mean(returns: Sequence[float]) -> float | None:
    return float(np.mean(returns)) if len(returns) else None


def _distribution(searched: Searched) -> Any:
    import optuna

    if searched.choices:
        return optuna.distributions.CategoricalDistribution(searched.choices)
    low, high = searched.low, searched.high
    if isinstance(low, int) and isinstance(high, int):
        return optuna.distributions.IntDistribution(low, high, log=searched.log, step=int(searched.step or 1))
    assert low is not None
    assert high is not None
    return optuna.distributions.FloatDistribution(low, high, log=searched.log, step=searched.step)
