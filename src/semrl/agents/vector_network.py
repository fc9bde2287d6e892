"""The Q-network of vectors without the framework: the same weights, in compiled code on the CPU.

Forwards, for one state or a batch, and backwards with Adam. Weights and the constants of the input are the memory of
PyTorch's tensors, so neither side has to know what the other did. Results differ from PyTorch's in the order of sums
alone. PyTorch's own Adam is not asked for: to make one takes it seconds.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
import torch
from torch import nn

from semrl.agents.config import DQNConfig
from semrl.agents.networks import FourierFeatures, QNetwork
from semrl.agents.replay import Batch
from semrl.agents.vector_kernels import activate, adam, loss_and_gradient, move_towards, pass_back, write_inputs
from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays, nest, unnest

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
class _Rows:
    """What the first dense layer is given of a batch.

    Of a list of objects most columns are alike in all rows: places that nobody has. They are multiplied once.
    """

    varying: Floats  # (b, v)
    columns: Ints  # (v,), which they are
    steady: Floats  # (k,), what the others hold; 0 in those that vary

    @classmethod
    def of(cls, rows: Floats) -> Self:
        """Tell which of the columns of ``(b, k)`` rows vary."""
        differs = (rows != rows[0]).any(axis=0)
        columns = np.flatnonzero(differs)
        return cls(varying=np.take(rows, columns, axis=1), columns=columns, steady=np.where(differs, 0, rows[0]))

    def __getitem__(self, some: slice) -> Self:
        return replace(self, varying=self.varying[some])

    def times(self, layer: _Layer) -> tuple[Floats, Floats]:
        """Return products with a layer's weights, ``(b, u)``, and what is the same in all rows, its bias included."""
        return self.varying @ np.take(layer.weight, self.columns, axis=1).T, layer.bias + layer.weight @ self.steady

    def gradient(self, back: Floats, bias_back: Floats) -> Floats:
        """Return the gradient of the weights, ``(u, k)``, of that of the sums, ``(b, u)``, and of the bias."""
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
        return self.forward(_Rows.of(rows))[0]

    @_UNWARNED
    def forward(self, rows: _Rows) -> tuple[Floats, list[_Pass]]:
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
    def backward(self, rows: _Rows, passes: list[_Pass], back: Floats) -> list[Floats]:
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


class VectorUpdates:
    """Updates of a DQN on vectors: loss, gradient, Adam, target network.

    Parameters
    ----------
    config
        See `DQNConfig`.
    network, target
        The online network and the target network, on the CPU; both learn in place.
    """

    def __init__(self, config: DQNConfig, network: QNetwork, target: QNetwork) -> None:
        self.config = config
        self.online, self.target = VectorNetwork(network), VectorNetwork(target)
        weights, targets = ([_view(p) for p in side.parameters()] for side in (network, target))
        self._weights, self._targets = ([part.reshape(-1) for part in side] for side in (weights, targets))
        self._moments = [(np.zeros_like(part), np.zeros_like(part)) for part in weights]
        self._steps = 0

    def loss_and_gradients(self, batch: Batch, n_actions: int) -> tuple[float, list[Floats]]:
        """Return the loss of a batch and its gradients, in the order of the parameters."""
        c, n = self.config, len(batch.states)
        states = np.concatenate([batch.states, batch.next_states])
        rows = _Rows.of(self.online.inputs(states, np.concatenate([batch.plans, batch.next_plans])))
        both, passes = self.online.forward(rows if c.double else rows[:n])
        following = self.target.forward(rows[n:])[0]
        shape = (n, c.heads, n_actions)
        back = np.empty(shape, np.float32)
        loss = loss_and_gradient(
            both[:n].reshape(shape), (both[n:] if c.double else following).reshape(shape), following.reshape(shape),
            batch.returns, batch.discounts, batch.actions, batch.advised, c.advice_margin, c.advice_weight, back,
        )  # fmt: skip
        return loss, self.online.backward(rows[:n], passes, back.reshape(n, -1))

    def step(self, gradients: list[Floats], learning_rate: float) -> None:
        """Take one step of Adam."""
        c = self.config
        self._steps += 1
        done = self._steps
        rates = np.array(
            [
                1 - c.adam_beta1, c.adam_beta2, 1 - c.adam_beta2, learning_rate / (1 - c.adam_beta1**done),
                math.sqrt(1 - c.adam_beta2**done), c.adam_epsilon,
            ],
            np.float32,
        )  # fmt: skip
        for weights, gradient, (mean, square) in zip(self._weights, gradients, self._moments, strict=True):
            adam(weights, gradient.ravel(), mean.reshape(-1), square.reshape(-1), rates)

    def moments_to_arrays(self) -> Arrays:
        """Return the moments of each parameter, as the arrays of PyTorch's Adam are named; none before a step."""
        if not self._steps:
            return {}
        parts = {
            str(i): {"step": np.array(self._steps, np.float32), "exp_avg": mean, "exp_avg_sq": square}
            for i, (mean, square) in enumerate(self._moments)
        }
        return nest(**parts)

    def moments_from_arrays(self, arrays: Arrays) -> None:
        """Take over what `moments_to_arrays` returned."""
        for i, moments in enumerate(self._moments):
            saved = unnest(arrays, str(i))
            for name, moment in zip(("exp_avg", "exp_avg_sq"), moments, strict=True):
                moment[...] = saved[name] if saved else 0
        self._steps = int(arrays["0/step"]) if arrays else 0

    def renew_target(self) -> None:
        """Move the target network towards the online network."""
        for old, new in zip(self._targets, self._weights, strict=True):
            move_towards(old, new, self.config.tau)


def _layers(dense: nn.Sequential) -> list[_Layer]:
    """Return views of the dense layers, the linear one behind them last."""
    layers: list[_Layer] = []
    norms = {i - 1: module for i, module in enumerate(dense) if isinstance(module, nn.LayerNorm)}
    for i, module in enumerate(dense):
        if isinstance(module, nn.Linear):
            weight, bias = _view(module.weight), _view(module.bias)
            norm = norms.get(i)
            gain, shift = (_view(norm.weight), _view(norm.bias)) if norm else (bias, bias)
            layers.append(_Layer(weight=weight, bias=bias, gain=gain, shift=shift, normed=norm is not None))
    return layers


def _view(parameter: torch.Tensor) -> Floats:
    view: Floats = parameter.detach().numpy()
    return view
