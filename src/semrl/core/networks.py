"""What all networks share: dense layers, and their weights and optimisers as named arrays."""

from collections.abc import Sequence

import torch
from torch import nn

from semrl.core.arrays import Arrays


def dense(n_inputs: int, hidden_units: Sequence[int], n_outputs: int, *, layer_norm: bool) -> nn.Sequential:
    """Make dense layers with ReLU, normalised before it if wanted (Ba et al. 2016), and a linear one behind them."""
    layers: list[nn.Module] = []
    width = n_inputs
    for units in hidden_units:
        layers += [nn.Linear(width, units)]
        layers += [nn.LayerNorm(units)] if layer_norm else []
        layers += [nn.ReLU()]
        width = units
    return nn.Sequential(*layers, nn.Linear(width, n_outputs))


def module_to_arrays(module: nn.Module) -> Arrays:
    """Return the weights by name; views of them where they are on the CPU."""
    return {name: value.cpu().numpy() for name, value in module.state_dict().items()}


def arrays_to_module(module: nn.Module, arrays: Arrays) -> None:
    """Load what `module_to_arrays` returned."""
    module.load_state_dict({name: torch.from_numpy(value.copy()) for name, value in arrays.items()})


def optimiser_to_arrays(optimiser: torch.optim.Optimizer) -> Arrays:
    """Return the moments of each parameter, as ``NUMBER/NAME``; views of them where they are on the CPU."""
    state = optimiser.state_dict()["state"]
    return {f"{i}/{name}": value.cpu().numpy() for i, moments in state.items() for name, value in moments.items()}


def arrays_to_optimiser(optimiser: torch.optim.Optimizer, arrays: Arrays) -> None:
    """Load what `optimiser_to_arrays` returned."""
    whole = optimiser.state_dict() | {"state": {}}
    for key, value in arrays.items():
        i, name = key.split("/")
        whole["state"].setdefault(int(i), {})[name] = torch.from_numpy(value.copy())
    optimiser.load_state_dict(whole)
