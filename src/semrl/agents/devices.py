"""Where networks compute."""

from typing import TYPE_CHECKING, Literal

from semrl.core.errors import UsageError

if TYPE_CHECKING:
    import torch

Device = Literal["auto", "cpu", "cuda", "mps"]


def is_there(name: Device) -> bool:
    """Tell whether this machine has the device of a name."""
    return name == "auto" or _there()[name]


def pick_device(name: Device) -> "torch.device":
    """Return the device of a name; ``"auto"`` takes a GPU where there is one.

    Raises
    ------
    UsageError
        When this machine has no such device.
    """
    import torch  # late: the names of devices are settings, and settings are read without torch

    there = _there()
    if name == "auto":
        return torch.device(next(kind for kind in ("cuda", "mps", "cpu") if there[kind]))
    if not there.get(name):
        raise UsageError(
            f"device '{name}' is not there; this machine has {', '.join(k for k, v in there.items() if v)}"
        )
    return torch.device(name)


def _there() -> dict[str, bool]:
    import torch

    return {"cpu": True, "cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
