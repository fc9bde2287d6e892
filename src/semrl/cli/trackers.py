"""Where measured numbers go besides the run's folder: TensorBoard, MLflow, each for those who have its extra."""

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

from semrl.core.errors import MissingExtraError, SemrlWarning
from semrl.core.files import write_text
from semrl.report.wording import flat
from semrl.training.config import RunConfig, to_dict
from semrl.training.trainer import Row, Trainer

MLFLOW_RUN = "mlflow.txt"
"""File of a run's folder with the id of its MLflow run, so that a resumed training goes on there."""


class Writer(Protocol):
    """Takes numbers."""

    def write(self, values: dict[str, float], decisions: int) -> None:
        """Write numbers by name, as of so many decisions."""

    def close(self, *, failed: bool) -> None:
        """Say that the training has ended."""


class Tracker:
    """Hands every measured number to a writer, over decisions; observes the trainer.

    Parameters
    ----------
    make
        Makes the writer, with the first row: that may make folders inside the run's, which must be new before.
    """

    def __init__(self, make: Callable[[], Writer]) -> None:
        self._make = make
        self._writer: Writer | None = None
        self._lost = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None and not self._lost:
            self._writer.close(failed=error is not None)

    def on_decision(self, trainer: Trainer) -> None:
        """Nothing is written between rows."""

    def on_row(self, row: Row) -> None:
        """Write the row's numbers under the name of its phase; a tracker that is lost ends no training."""
        if self._lost:
            return
        numbers = {name: value for name, value in row.items() if isinstance(value, int | float) and name != "decisions"}
        try:
            if self._writer is None:
                self._writer = self._make()
            self._writer.write({f"{row['phase']}/{name}": value for name, value in numbers.items()}, row["decisions"])
        except Exception as error:  # each tracker has errors of its own: a server that is gone, a full disk
            self._lost = True
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            warnings.warn(f"nothing more is tracked: {reason}; training goes on", SemrlWarning, stacklevel=2)


def tensorboard(path: Path) -> Tracker:
    """Return a tracker that writes TensorBoard events into a folder.

    Raises
    ------
    MissingExtraError
        When TensorBoard is not installed.
    """
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        raise MissingExtraError("tensorboard", "--tensorboard") from None
    return Tracker(lambda: _TensorBoard(SummaryWriter(str(path))))


class _TensorBoard:
    def __init__(self, writer: Any) -> None:
        self._writer = writer

    def write(self, values: dict[str, float], decisions: int) -> None:
        for name, value in values.items():
            self._writer.add_scalar(name, value, decisions)
        self._writer.flush()

    def close(self, *, failed: bool) -> None:  # noqa: ARG002 — events do not say how it ended
        self._writer.close()


def mlflow(run: Path, config: RunConfig) -> Tracker:
    """Return a tracker that writes to MLflow, where ``MLFLOW_TRACKING_URI`` says; settings become parameters.

    The experiment is that of ``MLFLOW_EXPERIMENT_NAME``, else ``semrl``.

    Raises
    ------
    MissingExtraError
        When MLflow is not installed.
    """
    try:
        from mlflow import MlflowClient
    except ImportError:
        raise MissingExtraError("mlflow", "--mlflow") from None
    return Tracker(lambda: _MLflow(MlflowClient(), run, config))


class _MLflow:
    def __init__(self, client: Any, run: Path, config: RunConfig) -> None:
        self._client = client
        kept = run / MLFLOW_RUN
        if kept.exists():
            self._id = kept.read_text(encoding="utf-8").strip()
            client.update_run(self._id, status="RUNNING")
            return
        name = os.environ.get("MLFLOW_EXPERIMENT_NAME", "semrl")
        known = client.get_experiment_by_name(name)
        experiment = known.experiment_id if known else client.create_experiment(name)
        self._id = client.create_run(experiment, run_name=run.name).info.run_id
        write_text(kept, f"{self._id}\n")
        for setting, value in flat(to_dict(config)):
            client.log_param(self._id, setting, value)

    def write(self, values: dict[str, float], decisions: int) -> None:
        for name, value in values.items():
            self._client.log_metric(self._id, name, float(value), step=decisions)

    def close(self, *, failed: bool) -> None:
        self._client.set_terminated(self._id, status="FAILED" if failed else "FINISHED")
