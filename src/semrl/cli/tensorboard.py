"""TensorBoard events, for those who have the extra 'tensorboard'."""

from pathlib import Path

from semrl.errors import MissingExtraError
from semrl.training import Row, Trainer


class TensorBoard:
    """Writes every measured number as a scalar over decisions; observes the trainer."""

    def __init__(self, path: Path) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:
            raise MissingExtraError("tensorboard", "--tensorboard") from None
        self._writer = SummaryWriter(str(path))

    def on_decision(self, trainer: Trainer) -> None:
        """Nothing is written between rows."""

    def on_row(self, row: Row) -> None:
        """Write the row's numbers under the name of its phase."""
        for name, value in row.items():
            if isinstance(value, int | float) and name not in ("decisions", "frames"):
                self._writer.add_scalar(f"{row['phase']}/{name}", value, row["decisions"])
        self._writer.flush()
