"""Inner loops of a small dense network: what lies between its matrix products, forwards and backwards, and Adam.

For a batch of some hundred rows and layers of some hundred units a framework spends as long between the products as in
them; here each layer's part is one pass over memory.
"""

import math

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import summing

LAYER_NORM_EPSILON = 1e-5
"""Added to the variance, as PyTorch does."""


@summing
def write_inputs(  # noqa: PLR0917 - compiled functions take no keywords
    states: Floats, plans: Floats, mean: Floats, scale: Floats, frequencies: int, rows: Floats
) -> None:
    """Write what the dense layers are given of ``(b, 2, d)`` states and ``(b, p)`` plans into ``(b, k)`` rows.

    It is what `StateInput` and `FourierFeatures` make of them. Sines and cosines of doubled angles follow from those of
    the angles, in double precision.
    """
    n, _, size = states.shape
    wide = 2 * size * frequencies
    sines, cosines = np.empty(2 * size), np.empty(2 * size)
    for b in range(n):
        for i in range(size):
            rows[b, i] = (states[b, 0, i] - mean[0, i]) * scale[0, i]
            rows[b, size + i] = ((states[b, 0, i] - states[b, 1, i]) - mean[1, i]) * scale[1, i]
        if frequencies:
            _write_waves(rows[b, : 2 * size], sines, cosines)
        for f in range(frequencies):
            for i in range(2 * size):
                at = 2 * size + i * frequencies + f
                rows[b, at], rows[b, at + wide] = sines[i], cosines[i]
            for i in range(2 * size):
                sine, cosine = sines[i], cosines[i]
                sines[i], cosines[i] = 2 * sine * cosine, 1 - 2 * sine * sine
        for i in range(plans.shape[1]):
            rows[b, 2 * size + 2 * wide + i] = plans[b, i]


@summing
def _write_waves(angles: Floats, sines: NDArray[np.float64], cosines: NDArray[np.float64]) -> None:
    """Write sine and cosine of ``(k,)`` angles: their series within an eighth of a turn, several at once."""
    for i in range(len(angles)):
        x = np.float64(angles[i])
        quarter = np.rint(x * (2 / math.pi))
        x -= quarter * (math.pi / 2)
        y = x * x
        sine = x * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72 * (1 - y / 110 * (1 - y / 156))))))
        cosine = 1 - y / 2 * (1 - y / 12 * (1 - y / 30 * (1 - y / 56 * (1 - y / 90 * (1 - y / 132 * (1 - y / 182))))))
        odd = quarter - 2 * np.floor(quarter / 2)  # 1 where sine and cosine change places
        turned = quarter - 4 * np.floor(quarter / 4)  # 0 … 3
        sign_s = 1.0 - 2.0 * np.floor(turned / 2)
        after = quarter + 1 - 4 * np.floor((quarter + 1) / 4)
        sign_c = 1.0 - 2.0 * np.floor(after / 2)
        sines[i] = sign_s * (sine + odd * (cosine - sine))
        cosines[i] = sign_c * (cosine + odd * (sine - cosine))


@summing
def activate(  # noqa: PLR0917 - compiled functions take no keywords
    sums: Floats, bias: Floats, gain: Floats, shift: Floats, normed: bool, spread: Floats, active: Floats
) -> None:
    """Add the bias to ``(b, u)`` sums, normalise them if wanted, and write what is above 0 into ``active``.

    Sums are replaced by what was normalised, and 1 / deviation goes into ``spread``, ``(b,)``: `pass_back` needs both.
    """
    n, units = sums.shape
    for b in range(n):
        row = sums[b]
        for i in range(units):
            row[i] += bias[i]
        if normed:
            total = np.float32(0)
            for i in range(units):
                total += row[i]
            mean, squares = total / np.float32(units), np.float32(0)
            for i in range(units):
                squares += (row[i] - mean) * (row[i] - mean)
            spread[b] = np.float32(1) / np.sqrt(squares / np.float32(units) + np.float32(LAYER_NORM_EPSILON))
            for i in range(units):
                row[i] = (row[i] - mean) * spread[b]
            for i in range(units):
                y = row[i] * gain[i] + shift[i]
                active[b, i] = np.float32(0) if y < 0 else y
        else:
            for i in range(units):
                active[b, i] = np.float32(0) if row[i] < 0 else row[i]


@summing
def pass_back(  # noqa: PLR0917 - compiled functions take no keywords
    back: Floats, active: Floats, normal: Floats, spread: Floats, gain: Floats, normed: bool,
    bias_back: Floats, gain_back: Floats, shift_back: Floats,
) -> None:  # fmt: skip
    """Turn gradients of what a layer gave, ``(b, u)``, into those of its sums, in place; write those of its weights."""
    n, units = back.shape
    bias_back[:], gain_back[:], shift_back[:] = 0, 0, 0
    for b in range(n):
        row = back[b]
        for i in range(units):
            row[i] = row[i] if active[b, i] > 0 else np.float32(0)
        if normed:
            along, total = np.float32(0), np.float32(0)
            for i in range(units):
                gain_back[i] += row[i] * normal[b, i]
                shift_back[i] += row[i]
                row[i] *= gain[i]
                total += row[i]
                along += row[i] * normal[b, i]
            total, along = total / np.float32(units), along / np.float32(units)
            for i in range(units):
                row[i] = (row[i] - total - normal[b, i] * along) * spread[b]
        for i in range(units):
            bias_back[i] += row[i]


@summing
def loss_and_gradient(  # noqa: PLR0917 - compiled functions take no keywords
    values: Floats, chosen: Floats, following: Floats, returns: Floats, discounts: Floats,
    actions: Ints, advised: Ints, margin: float, weight: float, back: Floats,
) -> float:  # fmt: skip
    """Return the loss of a batch (eq. 2.1) and write its gradient, ``(b, heads, n_actions)``.

    Parameters
    ----------
    values
        ``(b, heads, n_actions)``, of the states.
    chosen, following
        Likewise of the next states: by the one the next action is chosen, by the other it is valued.
    returns, discounts, actions, advised
        See `Batch`.
    margin, weight
        By how much an advised action should be worth more, and what falling short of it counts; 0: nothing.
    """
    n, heads, n_actions = values.shape
    share = np.float32(1 / (n * heads))
    given = 0
    for b in range(n):
        given += advised[b] >= 0
    per_advice = np.float32(weight / (given * heads)) if given and weight else np.float32(0)
    loss, missed = 0.0, 0.0
    back[:] = 0
    for b in range(n):
        for h in range(heads):
            best = following[b, h, np.argmax(chosen[b, h])]
            error = values[b, h, actions[b]] - (returns[b] + discounts[b] * best)
            inside = -1 < error < 1
            loss += 0.5 * error * error if inside else abs(error) - 0.5
            back[b, h, actions[b]] = (error if inside else np.sign(error)) * share
            if per_advice and advised[b] >= 0:
                top = advised[b]
                most = values[b, h, top]
                for a in range(n_actions):
                    if a != advised[b] and values[b, h, a] + np.float32(margin) > most:
                        top, most = a, values[b, h, a] + np.float32(margin)
                missed += most - values[b, h, advised[b]]
                back[b, h, top] += per_advice
                back[b, h, advised[b]] -= per_advice
    return float(loss * share + missed * per_advice)


@summing
def adam(weights: Floats, gradient: Floats, mean: Floats, square: Floats, rates: NDArray[np.float32]) -> None:
    """Take one step of Adam (Kingma and Ba 2015) in place; all are ``(k,)``.

    Rates are 1 - β₁, β₂, 1 - β₂, the step over its bias correction, the root of that of the squares, and ε.
    """
    rest1, beta2, rest2, step, root, epsilon = rates
    for i in range(len(weights)):
        g = gradient[i]
        mean[i] += rest1 * (g - mean[i])
        square[i] = beta2 * square[i] + rest2 * g * g
        weights[i] -= step * mean[i] / (np.sqrt(square[i]) / root + epsilon)


@summing
def move_towards(old: Floats, new: Floats, share: float) -> None:
    """Move ``(k,)`` numbers a share of the way towards others, in place; a share of 1 copies them exactly."""
    left = np.float32(1 - share)
    for i in range(len(old)):
        old[i] = new[i] - left * (new[i] - old[i])
