"""Training the runs of the evaluation side by side, and entering them into the ledger of a folder."""

from collections.abc import Callable, Sequence
from pathlib import Path

from semrl.sweep import LocalPool, Task, run_all
from semrl_thesis.ledger import Ledger, enter, score_of
from semrl_thesis.sweep import RunSpec


def train_all(
    specs: Sequence[RunSpec], folder: Path, ledger: Ledger, *, workers: int, say: Callable[[str], None]
) -> dict[str, str]:
    """Train what the ledger does not know yet, in this order; return runs that failed, and why.

    The folder gets ``runs/ID``, ``runs.csv``, ``trials.csv`` and ``returns/ID.csv``. Raises as `run_all` does.
    """
    waiting = {spec.id: spec for spec in specs if not ledger.is_done(spec)}

    def on_finished(task: Task) -> None:
        score, episodes, outcomes = score_of(waiting[task.id], task.run)
        enter(folder, score, episodes, outcomes)
        mean = "no episode finished" if score.mean is None else f"{score.mean:.1f} over the last episodes"
        say(f"{score.id} finished after {score.seconds / 60:.1f} minutes: {mean}")

    if not waiting:
        return {}
    tasks = [
        Task(id=id_, run=folder / "runs" / id_, config=spec.config(), trials=spec.trials)
        for id_, spec in waiting.items()
    ]
    states = run_all(tasks, LocalPool(workers), folder, say=say, on_finished=on_finished)
    return {state.task.id: state.problem for state in states if state.status == "failed"}
