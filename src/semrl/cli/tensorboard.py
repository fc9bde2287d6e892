"""TensorBoard events, for those who have the extra 'tensorboard'."""

from pathlib import Path
from typing import Any

from semrl.core.errors import MissingExtraError
from semrl.training.trainer import Row, Trainer


class TensorBoard:
    """Writes every measured number as a scalar over decisions; observes the trainer."""

    def __init__(self, path: Path) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:
            raise MissingExtraError("tensorboard", "--tensorboard") from None
        self.path = path
        self._make_writer = SummaryWriter
        self._writer: Any = None  # made with the first row: making it makes its folder, and the run's must be new

    def on_decision(self, trainer: Trainer) -> None:
        """Nothing is written between rows."""

    def on_row(self, row: Row) -> None:
        """Write the row's numbers under the name of its phase."""
        if self._writer is None:
            self._writer = self._make_writer(str(self.path))
        for name, value in row.items():
            if isinstance(value, int | float) and name != "decisions":
                self._writer.add_scalar(f"{row['phase']}/{name}", value, row["decisions"])
        self._writer.flush()
