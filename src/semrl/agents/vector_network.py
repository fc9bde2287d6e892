"""The Q-network of vectors without the framework: the same weights, in compiled code on the CPU.

Forwards, for one state or a batch, and backwards. Weights and the constants of the input are the memory of PyTorch's
tensors, so neither side has to know what the other did. Results differ from PyTorch's in the order of sums alone.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
import torch
from torch import nn

from semrl.agents.networks import FourierFeatures, QNetwork
from semrl.agents.vector_kernels import activate, pass_back, write_inputs
from semrl.core import Floats, Ints

_UNWARNED = np.errstate(over="ignore", invalid="ignore")  # of a loss that is no number the agent warns


@dataclass(frozen=True, kw_only=True, slots=True)
class _Layer:
    """Views of a dense layer's weights; without normalisation gain and shift are there and not looked at."""

    weight: Floats  # (u, k)
    bias: Floats  # (u,), as the following
    gain: Floats
    shift: Floats
    normed: bool


@dataclass(frozen=True, kw_only=True, slots=True)
class Rows:
    """What the first dense layer is given of a batch.

    Of a list of objects most columns are alike in all rows: places that nobody has. They are multiplied once.
    """

    varying: Floats  # (b, v)
    columns: Ints | None  # (v,), which they are; None where all vary
    steady: Floats  # (k,), what the others hold; 0 in those that vary

    @classmethod
    def of(cls, rows: Floats) -> Self:
        """Tell which of the columns of ``(b, k)`` rows vary."""
        differs = (rows != rows[0]).any(axis=0)
        if differs.all():
            return cls(varying=rows, columns=None, steady=np.zeros_like(rows[0]))
        columns = np.flatnonzero(differs)
        return cls(varying=np.take(rows, columns, axis=1), columns=columns, steady=np.where(differs, 0, rows[0]))

    def __getitem__(self, some: slice) -> Self:
        return replace(self, varying=self.varying[some])

    def times(self, layer: _Layer) -> tuple[Floats, Floats]:
        """Return products with a layer's weights, ``(b, u)``, and what is the same in all rows, its bias included."""
        if self.columns is None:
            return self.varying @ layer.weight.T, layer.bias
        return self.varying @ np.take(layer.weight, self.columns, axis=1).T, layer.bias + layer.weight @ self.steady

    def gradient(self, back: Floats, bias_back: Floats) -> Floats:
        """Return the gradient of the weights, ``(u, k)``, of that of the sums, ``(b, u)``, and of the bias."""
        if self.columns is None:
            return back.T @ self.varying
        gradient = np.outer(bias_back, self.steady)
        gradient[:, self.columns] = back.T @ self.varying
        return gradient


@dataclass(frozen=True, kw_only=True, slots=True)
class _Pass:
    """What one hidden layer made of a batch."""

    normal: Floats  # (b, u), sums, normalised if wanted
    spread: Floats  # (b,)
    active: Floats  # (b, u)


class VectorNetwork:
    """A Q-network of vectors on the CPU, forwards and backwards.

    Parameters
    ----------
    network
        Whose weights these are.
    """

    def __init__(self, network: QNetwork) -> None:
        body = network.body
        self._frequencies = len(body.factors) if isinstance(body, FourierFeatures) else 0
        self._mean, self._scale = network.state_input.mean.numpy(), network.state_input.scale.numpy()
        self._layers = _layers(network.dense)
        self._width = self._layers[0].weight.shape[1]

    def inputs(self, states: Floats, plans: Floats) -> Floats:
        """Return what the first dense layer is given, ``(b, k)``, for ``(b, 2, d)`` states and ``(b, p)`` plans."""
        rows = np.empty((len(states), self._width), np.float32)
        write_inputs(states, plans, self._mean, self._scale, self._frequencies, rows)
        return rows

    def values(self, rows: Floats) -> Floats:
        """Return the outputs, ``(b, n_values)``, for what `inputs` returned."""
        return self.forward(Rows.of(rows))[0]

    @_UNWARNED
    def forward(self, rows: Rows) -> tuple[Floats, list[_Pass]]:
        """Return the outputs and what `backward` needs of the way there."""
        passes: list[_Pass] = []
        sums, bias = rows.times(self._layers[0])
        for layer, following in pairwise(self._layers):
            spread, active = np.empty(len(sums), np.float32), np.empty_like(sums)
            activate(sums, bias, layer.gain, layer.shift, layer.normed, spread, active)
            passes.append(_Pass(normal=sums, spread=spread, active=active))
            sums, bias = active @ following.weight.T, following.bias
        return sums + bias, passes

    @_UNWARNED
    def backward(self, rows: Rows, passes: list[_Pass], back: Floats) -> list[Floats]:
        """Return the gradients of all weights, in the order of the module's parameters.

        Parameters
        ----------
        rows
            Of what `forward` was given the first ``n``.
        passes
            What it returned.
        back
            ``(n, n_values)``, gradient of the outputs of these; the others do not matter.
        """
        gradients: list[Floats] = []
        count = len(back)
        for place in range(len(self._layers) - 1, -1, -1):
            layer = self._layers[place]
            if place == len(passes):
                bias_back, norm_back = back.sum(axis=0), []
            else:
                done = passes[place]
                bias_back, *norm_back = (np.empty(len(layer.bias), np.float32) for _ in range(3))
                pass_back(
                    back, done.active[:count], done.normal[:count], done.spread[:count], layer.gain, layer.normed,
                    bias_back, *norm_back,
                )  # fmt: skip
            weight_back = back.T @ passes[place - 1].active[:count] if place else rows.gradient(back, bias_back)
            gradients = [weight_back, bias_back, *(norm_back if layer.normed else []), *gradients]
            if place:
                back = back @ layer.weight
        return gradients


def _layers(dense: nn.Sequential) -> list[_Layer]:
    """Return views of the dense layers, the linear one behind them last."""
    layers: list[_Layer] = []
    norms = {i - 1: module for i, module in enumerate(dense) if isinstance(module, nn.LayerNorm)}
    for i, module in enumerate(dense):
        if isinstance(module, nn.Linear):
            weight, bias = view_of(module.weight), view_of(module.bias)
            norm = norms.get(i)
            gain, shift = (view_of(norm.weight), view_of(norm.bias)) if norm else (bias, bias)
            layers.append(_Layer(weight=weight, bias=bias, gain=gain, shift=shift, normed=norm is not None))
    return layers


def view_of(parameter: torch.Tensor) -> Floats:
    """Return the memory of a tensor on the CPU as an array."""
    view: Floats = parameter.detach().numpy()
    return view
