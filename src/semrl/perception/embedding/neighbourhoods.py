"""What each object is surrounded by, as compiled hashes (Weisfeiler and Lehman; §3.2.3, Fig. 3.7)."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints, SceneGraph
from semrl.core.kernels import compiled
from semrl.perception.embedding.blake2 import blake2b

LABEL_BYTES = 32
"""Length of a hash in hexadecimal digits; a class number is never longer."""


_DIGITS = np.frombuffer(b"0123456789abcdef", np.uint8)
_NO_SALT = np.uint64(0)

Texts = NDArray[np.uint8]
"""Words of one length as ASCII, the last axis; shorter ones end in zeros."""


def neighbourhood_labels(graph: SceneGraph, iterations: int) -> Texts:
    """Hash the surroundings of each object.

    An object's label is its class number at first. Each iteration replaces it by the hash of itself and
    the sorted labels of the neighbours, so that after ``k`` iterations it tells what lies within ``k``
    edges. The hashes do not depend on the process, the order of objects or the lengths of edges.

    Parameters
    ----------
    graph
        The scene, ``n`` objects.
    iterations
        How many hashes each object gets.

    Returns
    -------
    ``(n, iterations, 32)`` uint8: hexadecimal digits, the 128-bit BLAKE2b digests that networkx makes.
    """
    return _labels(graph.classes, graph.edges, iterations)


@compiled
def hash_texts(texts: Texts, salt: np.uint64) -> NDArray[np.uint64]:
    """Hash ``(n, k, 32)`` full-length words to 64 bits each, ``(n, k)`` uint64."""
    hashes = np.empty(texts.shape[:2], np.uint64)
    for i in range(texts.shape[0]):
        for j in range(texts.shape[1]):
            hashes[i, j] = blake2b(texts[i, j], 8, salt)[0]
    return hashes


@compiled
def _labels(classes: Ints, edges: Ints, iterations: int) -> Texts:
    n = len(classes)
    found = np.zeros((n, iterations, LABEL_BYTES), np.uint8)
    labels = np.zeros((n, LABEL_BYTES), np.uint8)
    lengths = np.empty(n, np.int64)
    for i in range(n):
        lengths[i] = write_number(classes[i], labels[i])
    starts, neighbours = _adjacency(n, edges)
    longest = np.max(np.diff(starts)) if n else 0
    message = np.empty((longest + 1) * LABEL_BYTES, np.uint8)
    for iteration in range(iterations):
        ranked = _sorted_neighbours(_sorted_places(labels), starts, neighbours)
        for i in range(n):
            end = lengths[i]
            message[:end] = labels[i, :end]
            for j in ranked[starts[i] : starts[i + 1]]:
                message[end : end + lengths[j]] = labels[j, : lengths[j]]
                end += lengths[j]
            _write_digest(blake2b(message[:end], LABEL_BYTES // 2, _NO_SALT), found[i, iteration])
        labels[:] = found[:, iteration]
        lengths[:] = LABEL_BYTES
    return found


@compiled
def write_number(number: int, text: NDArray[np.uint8]) -> int:
    """Write an integer in decimal digits; return how many characters that are."""
    length = 0
    rest = np.uint64(number)
    if number < 0:
        text[0], length = ord("-"), 1
        rest = ~rest + np.uint64(1)
    end = length + 1
    power = np.uint64(1)
    while rest // power >= np.uint64(10):
        power *= np.uint64(10)
        end += 1
    while length < end:
        text[length] = _DIGITS[rest // power]
        rest %= power
        power //= np.uint64(10)
        length += 1
    return length


@compiled
def _write_digest(words: NDArray[np.uint64], text: NDArray[np.uint8]) -> None:
    """Write the first 16 bytes of a digest in hexadecimal digits."""
    for i in range(LABEL_BYTES // 2):
        byte = (words[i >> 3] >> np.uint64(8 * (i & 7))) & np.uint64(255)
        text[2 * i] = _DIGITS[byte >> np.uint64(4)]
        text[2 * i + 1] = _DIGITS[byte & np.uint64(15)]


@compiled
def _adjacency(n: int, edges: Ints) -> tuple[Ints, Ints]:
    """Return where each object's neighbours begin, and all neighbours object by object."""
    starts = np.zeros(n + 1, np.int64)
    for i in range(len(edges)):
        for end in edges[i]:
            starts[end + 1] += 1
    starts = np.cumsum(starts)
    filled = starts[:-1].copy()
    neighbours = np.empty(2 * len(edges), np.int64)
    for i in range(len(edges)):
        for end in range(2):
            owner = edges[i, end]
            neighbours[filled[owner]] = edges[i, 1 - end]
            filled[owner] += 1
    return starts, neighbours


@compiled
def _sorted_neighbours(order: Ints, starts: Ints, neighbours: Ints) -> Ints:
    """Return the neighbours of each object in the order given: handed out in that order, they need no sorting."""
    filled = starts[:-1].copy()
    ranked = np.empty_like(neighbours)
    for j in order:
        for owner in neighbours[starts[j] : starts[j + 1]]:
            ranked[filled[owner]] = j
            filled[owner] += 1
    return ranked


@compiled
def _sorted_places(labels: Texts) -> Ints:
    """Return the places of labels in ascending order (Shell's sort; equal ones in any order)."""
    n = len(labels)
    order = np.arange(n)
    gap = n // 2
    while gap > 0:
        for i in range(gap, n):
            moving, j = order[i], i
            while j >= gap and _precedes(labels[moving], labels[order[j - gap]]):
                order[j] = order[j - gap]
                j -= gap
            order[j] = moving
        gap //= 2
    return order


@compiled
def _precedes(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> bool:
    for k in range(len(a)):
        if a[k] != b[k]:
            return a[k] < b[k]  # type: ignore[no-any-return]
    return False
