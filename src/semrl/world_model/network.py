"""The small network behind the models of §3.4.3: dense layers, trained by torch, asked through numpy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from semrl.core import Floats, Ints, Transitions
from semrl.core.arrays import Arrays, array_to_rng, nest, rng_to_array, unnest
from semrl.core.errors import SemrlError
from semrl.core.networks import arrays_to_module, arrays_to_optimiser, dense, module_to_arrays, optimiser_to_arrays
from semrl.core.protocols import Saved

LEAST_DEVIATION = 0.1
"""Smallest deviation that inputs are divided by, as a share of the root mean square over all of them."""


def features(states: Floats, previous: Floats, actions: Ints, n_actions: int) -> Floats:
    """Lay out what both models see: state, difference and action (Fig. 3.9), ``(b, 2 d + n_actions)`` float32."""
    chosen = np.zeros((len(actions), n_actions), np.float32)
    chosen[np.arange(len(actions)), actions] = 1
    return np.concatenate([states, states - previous, chosen], axis=1, dtype=np.float32)


def spread(rows: Floats) -> Floats:
    """Return how far each column varies, ``(d,)``, none close to 0: what hardly varied yet may vary later."""
    # Mean absolute deviations: a ball that is served anew jumps across the picture, which squares would blow up.
    deviation = np.abs(rows - np.median(rows, axis=0)).mean(axis=0)
    least = LEAST_DEVIATION * float(np.sqrt(np.mean(deviation**2)))
    floored: Floats = np.maximum(deviation, least) if least > 0 else np.ones_like(deviation)
    return floored


class DenseNetwork:
    """Dense layers with ReLU and a linear one, learned by Adam in mini-batches.

    Parameters
    ----------
    n_inputs, hidden_units, n_outputs
        Widths.
    layer_norm
        Normalise each hidden layer before its activation (Ba et al. 2016).
    learning_rate, betas
        Of Adam.
    batch_size
        Rows of a mini-batch.
    seed
        Of weights and of the order of rows.
    """

    def __init__(
        self,
        n_inputs: int,
        hidden_units: tuple[int, ...],
        n_outputs: int,
        *,
        layer_norm: bool,
        learning_rate: float,
        betas: tuple[float, float],
        batch_size: int,
        seed: int,
    ) -> None:
        self.batch_size = batch_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.layers = dense(n_inputs, hidden_units, n_outputs, layer_norm=layer_norm)
        self.optimiser = torch.optim.Adam(self.layers.parameters(), lr=learning_rate, betas=betas, fused=True)
        self._rng = np.random.default_rng(seed)
        # Views of the same memory: for a handful of rows numpy answers several times faster than torch.
        self._steps = [(layer, [p.detach().numpy() for p in layer.parameters()]) for layer in self.layers]

    def __call__(self, inputs: Floats) -> Floats:
        """Return the outputs, ``(b, n_outputs)`` float32, for ``(b, n_inputs)`` float32."""
        rows = inputs
        for layer, parameters in self._steps:
            if isinstance(layer, nn.Linear):
                weights, offsets = parameters
                rows = rows @ weights.T
                rows += offsets
            elif isinstance(layer, nn.LayerNorm):
                gains, offsets = parameters
                rows -= rows.mean(axis=1, keepdims=True)
                rows *= gains / np.sqrt(np.square(rows).mean(axis=1, keepdims=True) + layer.eps)
                rows += offsets
            else:
                np.maximum(rows, 0, out=rows)
        return rows

    def learn(self, inputs: Floats, targets: NDArray[Any], loss: Callable[[Tensor, Tensor], Tensor]) -> None:
        """Pass over all rows once, in mini-batches of a random order.

        Raises
        ------
        SemrlError
            When the loss is not a number.
        """
        order = self._rng.permutation(len(inputs))
        for start in range(0, len(order), self.batch_size):
            rows = order[start : start + self.batch_size]
            error = loss(self.layers(torch.from_numpy(inputs[rows])), torch.from_numpy(targets[rows]))
            self.optimiser.zero_grad(set_to_none=True)
            error.backward()  # type: ignore[no-untyped-call]
            self.optimiser.step()
        if len(order) and not np.isfinite(error.item()):
            raise SemrlError("a model of the map has diverged: try a smaller learning rate for it")

    def to_arrays(self) -> Arrays:
        """Return weights, the optimiser's moments and the random generator."""
        own = nest(layers=module_to_arrays(self.layers), adam=optimiser_to_arrays(self.optimiser))
        return {name: value.copy() for name, value in own.items()} | {"rng": rng_to_array(self._rng)}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called."""
        arrays_to_module(self.layers, unnest(arrays, "layers"))
        arrays_to_optimiser(self.optimiser, unnest(arrays, "adam"))
        self._rng = array_to_rng(arrays["rng"])


class NetworkModel(Saved):
    """What both models have in common when they are networks: scaled features go in, and the scales stay.

    Parameters
    ----------
    network
        Takes `features`.
    dimension
        Length of a state.
    n_actions
        Number of actions.
    """

    SAVED: tuple[str, ...] = ("_centre", "_scale", "is_fitted")
    PARTS = ("network",)

    def __init__(self, network: DenseNetwork, dimension: int, n_actions: int) -> None:
        self.network = network
        self.dimension = dimension
        self.n_actions = n_actions
        self.is_fitted = False
        self._centre = np.zeros(2 * dimension + n_actions, np.float32)
        self._scale = np.ones(2 * dimension + n_actions, np.float32)

    def _fit_scale(self, transitions: Transitions) -> None:
        """Measure the scales of the features."""
        rows = features(transitions.states, transitions.previous, transitions.actions, self.n_actions)
        self._centre, self._scale = rows.mean(axis=0), spread(rows)

    def _rows(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return scaled features."""
        return (features(states, previous, actions, self.n_actions) - self._centre) / self._scale
