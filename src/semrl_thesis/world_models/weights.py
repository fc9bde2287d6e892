"""Weights of networks: seeded without touching the global generator, saved as named arrays."""

from collections.abc import Callable
from typing import TypeVar

import torch
from torch import nn

from semrl.core.arrays import Arrays

Module = TypeVar("Module", bound=nn.Module)


def seeded(make: Callable[[], Module], seed: int) -> Module:
    """Make a network whose initial weights follow from a seed; PyTorch's global generator stays as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return make()


def to_arrays(module: nn.Module) -> Arrays:
    """Return copies of the weights, by name."""
    return {name: value.numpy().copy() for name, value in module.state_dict().items()}


def load_arrays(module: nn.Module, arrays: Arrays) -> None:
    """Set the weights to what `to_arrays` returned."""
    module.load_state_dict({name: torch.from_numpy(value.copy()) for name, value in arrays.items()})
