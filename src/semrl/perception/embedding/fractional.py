"""An embedding that needs no training and has near positions near: places as phases.

Fractional power encoding, from vector symbolic architectures: Plate, "Holographic reduced representations", IEEE
Transactions on Neural Networks 6, 1995; Komer, Stewart, Voelker and Eliasmith, "A neural representation of
continuous space using fractional binding", CogSci 2019.
"""

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, SceneGraph
from semrl.core.errors import UsageError
from semrl.core.kernels import compiled
from semrl.core.memo import Memo
from semrl.perception.embedding.scene_graph import object_keys
from semrl.perception.embedding.unlearned import Unlearned

_ONE = 1 << 30
"""What a component of 1 counts: sums are of integers, so that their order does not matter to the last bit."""

_GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True, kw_only=True, slots=True)
class FractionalEmbeddingConfig:
    """Settings of `FractionalEmbedding`."""

    dimension: int = 128
    """Length of the vectors, an even number."""
    width_px: float = 16.0
    """How far apart two places are, in pixels, whose similarity has fallen to exp(−1/2)."""
    seed: int = 0
    """Selects the phases of the classes, from 0 on."""

    def __post_init__(self) -> None:
        if self.dimension < 2 or self.dimension % 2:
            raise UsageError(f"dimension must be an even number from 2 on, not {self.dimension}")
        if not 0.5 <= self.width_px < np.inf:
            raise UsageError(f"width_px must be half a pixel or more, not {self.width_px}")
        if not 0 <= self.seed < 1 << 64:
            raise UsageError(f"seed must lie between 0 and 2^64 - 1, not {self.seed}")


class FractionalEmbedding(Unlearned):
    """Embeds a scene as the sum of its objects: class and place bound together as phases.

    Component k of an object of class c at place p is the complex number exp(i (ω_k · p + φ_k(c))), written as its
    real and its imaginary part; ω_k is a frequency, φ_k(c) a random phase, which is fractional binding in the
    frequency domain. The inner product of two objects of one class at p and q is the mean of cos(ω_k · (p − q)) over
    all k: with frequencies as a normal distribution of deviation 1 / width has them that is near
    exp(−|p − q|² / (2 width²)) (Bochner's theorem; Rahimi and Recht, "Random features for large-scale kernel
    machines", NIPS 2007). Objects of different classes have phases that know nothing of each other, and an inner
    product near 0. So near scenes have near vectors, and since sines and cosines of places stand in them, places can be
    read off by a linear function.

    The frequencies are not drawn but spread evenly, radii by quantiles and directions by the golden ratio, which
    covers the distribution better than chance (Yang et al., "Quasi-Monte Carlo feature maps", ICML 2014).

    An object has length 1 whatever else is in the picture. Places are taken to half a pixel.
    """

    def __init__(self, config: FractionalEmbeddingConfig | None = None) -> None:
        self.config = config or FractionalEmbeddingConfig()
        super().__init__(self.config.dimension)
        self._frequencies = _spread_frequencies(self.config.dimension // 2, self.config.width_px)
        self._scale = np.float32(1 / _ONE)
        self._objects = Memo(self._embed_objects, width=3)  # class, doubled row and column → its vector

    def transform(self, graph: SceneGraph) -> Floats:
        """Embed a scene, ``(dimension,)`` float32: a pure function of its objects and the configuration."""
        vectors, places = self._objects.look_up(object_keys(graph))
        return _sum_rows(vectors, places, self._scale)

    def objects(self, graph: SceneGraph) -> Floats:
        """Embed each object on its own, ``(n, dimension)`` float32; a scene is their sum."""
        vectors, places = self._objects.look_up(object_keys(graph))
        rows: Floats = vectors[places].astype(np.float32) * self._scale
        return rows

    def _embed_objects(self, keys: Ints) -> Ints:
        """Return the vectors of ``(k, 3)`` objects as whole numbers, ``(k, dimension)``."""
        phases = np.zeros((len(keys), self.dimension // 2))
        for row, number in zip(phases, keys[:, 0].tolist(), strict=True):
            row[:] = self._class_phases(number)
        return _turn(keys, self._frequencies, phases, _ONE / np.sqrt(self.dimension // 2))

    def _class_phases(self, number: int) -> NDArray[np.float64]:
        """Return the phases of a class, ``(dimension / 2,)`` in 0 … 2π, drawn by a hash of its number."""
        count = self.dimension // 2
        digest = hashlib.shake_128(f"{self.config.seed} {number}".encode()).digest(4 * count)
        phases: NDArray[np.float64] = np.frombuffer(digest, "<u4") * (2 * np.pi / 2**32)
        return phases


@compiled
def _turn(keys: Ints, frequencies: NDArray[np.float64], phases: NDArray[np.float64], length: float) -> Ints:
    """Return the vectors of objects; number by number, so that no bit depends on how many there are."""
    count = phases.shape[1]
    vectors = np.empty((len(keys), 2 * count), np.int64)
    for i in range(len(keys)):
        row, column = keys[i, 1] / 2, keys[i, 2] / 2
        for k in range(count):
            angle = row * frequencies[0, k] + column * frequencies[1, k] + phases[i, k]
            vectors[i, k] = np.int64(np.rint(np.cos(angle) * length))
            vectors[i, count + k] = np.int64(np.rint(np.sin(angle) * length))
    return vectors


@compiled
def _sum_rows(rows: Ints, places: Ints, scale: np.float32) -> Floats:
    """Sum the rows of ``(c, dimension)`` that are named, and scale the sum."""
    total = np.zeros(rows.shape[1], np.int64)
    for place in places:
        total += rows[place]
    return total.astype(np.float32) * scale


def _spread_frequencies(count: int, width_px: float) -> NDArray[np.float64]:
    """Return ``(2, count)`` frequencies in radians a pixel, distributed normally around 0.

    The radius of two normal numbers exceeds r with probability exp(−r² / 2), so its quantiles have a formula. ω and
    −ω are the same cosine: half the directions are all.
    """
    steps = np.arange(count)
    radii = np.sqrt(-2 * np.log1p(-(steps + 0.5) / count)) / width_px
    directions = np.pi * ((steps * _GOLDEN) % 1)
    return np.asarray(radii * np.stack([np.sin(directions), np.cos(directions)]))
