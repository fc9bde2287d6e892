"""Inferring vectors by PV-DBOW down a Huffman tree, compiled: what gensim does, in a quarter of its time.

Gensim calls a library for each sum over a vector's numbers; here they are taken in place, for four inner nodes at once.
Random numbers, the table of the sigmoid and the order of steps are gensim's, so vectors differ from its own by what
sums in another order come to.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import summing

_LIMIT = np.float32(6)
"""Inner products beyond it are as good as certain; gensim takes no step for them."""

_CELLS = 1000
"""Length of the sigmoid's table."""

_CELLS_PER_UNIT = np.float32(_CELLS // 6 // 2)
"""As gensim counts them: rounded down, so that its table is read a little to the left of where it should be."""

ABREAST = 4
"""How many inner nodes are looked at together."""

_AGAIN, _PLUS, _MASK = np.uint64(25214903917), np.uint64(11), np.uint64((1 << 48) - 1)
"""The generator of random numbers that is also C's ``drand48``."""


class Tree(NamedTuple):
    """What inferring needs of a trained model of ``v`` words, with ``k`` inner nodes on all their paths together."""

    weights: Floats
    """``(v, d)`` float32, of the inner nodes; those of the last are 0, which paths are filled up with."""
    starts: Ints
    """``(v + 1,)`` int64: where each word's path begins in what follows."""
    nodes: Ints
    """``(k,)`` int64, inner nodes from the root to each word, a multiple of `ABREAST` for each."""
    turns: NDArray[np.float32]
    """``(k,)`` float32, 1 for left and 0 for right at each."""
    sampling: NDArray[np.uint32]
    """``(v,)`` uint32: a word is skipped where this is below a number drawn from all of 32 bits."""
    sigmoid: NDArray[np.float32]
    """``(1000,)`` float32, of −6 … 6."""


def tree_of(weights: Floats, paths: list[Ints], codes: list[Ints], sampling: NDArray[np.uint32]) -> Tree:
    """Lay out the paths of all words, one after the other.

    Parameters
    ----------
    weights
        Of the inner nodes.
    paths, codes
        Inner nodes on the way to each word, and 0 or 1 for each.
    sampling
        See `Tree`.
    """
    exponents = np.exp(((np.arange(_CELLS, dtype=np.float32) / np.float32(_CELLS)) * 2 - 1) * np.float64(_LIMIT))
    powers = exponents.astype(np.float32)
    lengths = [len(path) + -len(path) % ABREAST for path in paths]
    return Tree(
        weights=np.concatenate([weights, np.zeros((1, weights.shape[1]), np.float32)]),
        starts=np.cumsum([0, *lengths]),
        nodes=_filled_up(paths, lengths, len(weights)).astype(np.int64),
        turns=1 - _filled_up(codes, lengths, 0).astype(np.float32),
        sampling=np.ascontiguousarray(sampling),
        sigmoid=powers / (powers + np.float32(1)),
    )


def _filled_up(parts: list[Ints], lengths: list[int], filling: int) -> Ints:
    """Return parts one behind the other, each filled up to its length."""
    pairs = zip(parts, lengths, strict=True)
    return np.concatenate([np.pad(part, (0, length - len(part)), constant_values=filling) for part, length in pairs])


@summing
def infer(  # noqa: PLR0917 - compiled functions take no keywords
    words: Ints, tree: Tree, rates: Floats, chances: NDArray[np.uint64], sampled: bool, vector: Floats
) -> None:
    """Learn the vector of one scene, ``(d,)`` float32, in place.

    Parameters
    ----------
    words
        ``(n,)`` int64, those of the vocabulary.
    tree
        See `Tree`.
    rates, chances
        Learning rate, and state of the random generator, at the start of each pass.
    sampled
        Whether frequent words are skipped at random.
    vector
        Where it begins.
    """
    step = np.empty_like(vector)
    for epoch in range(len(rates)):
        chance = chances[epoch]
        for word in words:
            if sampled:
                drawn = np.uint32(chance >> np.uint64(16))
                chance = (chance * _AGAIN + _PLUS) & _MASK
                if tree.sampling[word] < drawn:
                    continue
            _step(word, tree, rates[epoch], step, vector)


@summing
def _step(word: int, tree: Tree, rate: float, step: Floats, vector: Floats) -> None:
    """Move a vector towards foretelling one word: four inner nodes at once."""
    step[:] = 0
    for at in range(tree.starts[word], tree.starts[word + 1], ABREAST):
        a, b = tree.weights[tree.nodes[at]], tree.weights[tree.nodes[at + 1]]
        c, d = tree.weights[tree.nodes[at + 2]], tree.weights[tree.nodes[at + 3]]
        along_a = along_b = along_c = along_d = np.float32(0)
        for i in range(len(vector)):
            along_a += vector[i] * a[i]
            along_b += vector[i] * b[i]
            along_c += vector[i] * c[i]
            along_d += vector[i] * d[i]
        share_a, share_b = _share(along_a, at, tree, rate), _share(along_b, at + 1, tree, rate)
        share_c, share_d = _share(along_c, at + 2, tree, rate), _share(along_d, at + 3, tree, rate)
        for i in range(len(vector)):
            step[i] += share_a * a[i] + share_b * b[i] + share_c * c[i] + share_d * d[i]
    for i in range(len(vector)):
        vector[i] += step[i]


@summing
def _share(along: np.float32, at: int, tree: Tree, rate: float) -> np.float32:
    """Return by how much of an inner node's weights a vector moves, of their inner product and place on the path."""
    if not -_LIMIT < along < _LIMIT:
        return np.float32(0)
    cell = int((along + _LIMIT) * _CELLS_PER_UNIT)
    return np.float32((tree.turns[at] - tree.sigmoid[cell]) * rate)
