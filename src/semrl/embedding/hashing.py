"""An embedding that needs no training: the words of a scene hashed into a vector.

Signed feature hashing (Weinberger, Dasgupta, Langford, Smola and Attenberg, "Feature hashing for large
scale multitask learning", ICML 2009). Inner products of the vectors are, in expectation over the hash
function, those of the scenes' word counts. Nothing is learned, so nothing can drift.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from semrl.arrays import Arrays
from semrl.embedding.word_hashes import Hashes, WordHasher
from semrl.embedding.words import WordsConfig
from semrl.errors import UsageError
from semrl.kernels import compiled
from semrl.memo import Memo
from semrl.types import Floats, Ints, SceneGraph

MAX_SPREAD_PX = 32.0


_ONE = 64
"""What a word of weight 1 adds: sums are of integers, so that their order does not matter to the last bit."""


@dataclass(frozen=True, kw_only=True, slots=True)
class HashedEmbeddingConfig:
    """Settings of `HashedEmbedding`."""

    dimension: int = 128
    """Length of the vectors."""

    words: WordsConfig = field(default_factory=WordsConfig)
    """Which words describe a scene."""

    spread_px: float = 0.0
    """Position words are spread over the neighbouring positions within this distance; 0: they stand alone."""

    neighbourhood_weight: float = 1.0
    """How much a Weisfeiler–Lehman hash counts, against 1 for a position word."""

    seed: int = 0
    """Selects the hash function, from 0 on."""

    def __post_init__(self) -> None:
        if self.dimension < 1:
            raise UsageError(f"dimension must be 1 or more, not {self.dimension}")
        if not (0 <= self.spread_px <= MAX_SPREAD_PX and 0 <= self.neighbourhood_weight <= 1000):
            raise UsageError(f"spread_px must lie in 0 … {MAX_SPREAD_PX:g} and neighbourhood_weight in 0 … 1000")
        if not 0 <= self.seed < 1 << 64:
            raise UsageError(f"seed must lie between 0 and 2^64 - 1, not {self.seed}")


class HashedEmbedding:
    """Embeds a scene as the signed sum of its hashed words.

    Every word adds +1 or −1 to one component; its hash says which. The sum is divided by the root of the
    number of words an object has, which gives one object the expected length 1. This factor is the same
    for all scenes, unlike a norm: moving one object changes the vector by the same amount whatever else
    is in the picture, and the inputs of a network stay of the order of 1.

    Words of neighbouring positions have nothing in common, so an object that moves by a pixel looks like
    another object. With ``spread_px`` an object also says, less loudly, the words of the positions around
    it: its vector is the mean of theirs under a triangular window, a smooth function of its centre, to
    half a pixel.

    Parameters
    ----------
    config
        Settings; the defaults if none are given.
    """

    def __init__(self, config: HashedEmbeddingConfig | None = None) -> None:
        self.config = config or HashedEmbeddingConfig()
        window = np.array(_window(0.0, self.config.spread_px)[1])
        # A word that names one coordinate is met at every position of the other: its spread copies have this length.
        length = float(np.sqrt((window**2).sum()) * window.sum())
        self._class_weight = round(_ONE * length)
        self._hash_weight = round(_ONE * length * self.config.neighbourhood_weight)
        self._scale = np.float32(1 / (_ONE * length * np.sqrt(max(self.config.words.words_per_object, 1))))
        self._hasher = WordHasher(self.config.words, self.config.seed)
        self._objects = Memo(self._sum_objects, width=3)  # class, doubled row and column → its words' signed sum

    @property
    def documents_needed(self) -> int:
        """0: there is nothing to learn."""
        return 0

    @property
    def dimension(self) -> int:
        """Length of the vectors."""
        return self.config.dimension

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:  # noqa: ARG002 - the protocol's signature
        """Do nothing and return ``self``: there is nothing to learn."""
        return self

    def transform(self, graph: SceneGraph) -> Floats:
        """Embed a scene.

        A pure function of the scene and the configuration, the same bits in every process: words are
        counted as integers, so the order of the sum does not matter, and scaled once.

        Parameters
        ----------
        graph
            The scene.

        Returns
        -------
        ndarray
            ``(dimension,)`` float32; zeros for a scene without objects.
        """
        halves = np.rint(graph.centres_px * 2).astype(np.int64)  # (n, 2), in half pixels
        sums, places = self._objects.look_up(np.column_stack([graph.classes, halves]))
        total = add_rows(sums, places)
        if self._hash_weight:
            add_words(total, self._hasher.surroundings(graph), self._hash_weight)
        return total.astype(np.float32) * self._scale

    def to_arrays(self) -> Arrays:
        """Return nothing: there is no state."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""

    def _sum_objects(self, keys: Ints) -> Ints:
        """Sum the words of each of ``(k, 3)`` objects, ``(k, dimension)``."""
        sums = np.zeros((len(keys), self.dimension), np.int64)
        for total, (number, row, column) in zip(sums, keys.tolist(), strict=True):
            self._sum_object(total, number, row / 2, column / 2)
        return sums

    def _sum_object(self, total: Ints, number: int, row: float, column: float) -> None:
        """Add the words of an object, those of its position spread over the neighbouring ones."""
        rows, row_weights = _window(row, self.config.spread_px)
        columns, column_weights = _window(column, self.config.spread_px)
        places = np.array([(r, c) for r in rows for c in columns])  # (p, 2)
        weights = _ONE * np.outer(row_weights, column_weights).ravel()  # (p,)
        words = self._hasher.places(np.full(len(places), number), places)  # (p, w)
        for word_hashes, weight in zip(words, weights.tolist(), strict=True):
            add_words(total, word_hashes[None, 1:], weight)
        add_words(total, words[:1, :1], self._class_weight)


@compiled
def add_rows(sums: Ints, places: Ints) -> Ints:
    """Sum the named rows of ``(c, dimension)`` sums."""
    total = np.zeros(sums.shape[1], np.int64)
    for place in places:
        total += sums[place]
    return total


@compiled
def add_words(total: Ints, hashes: Hashes, weight: int) -> None:
    """Count words: the lowest bit of a word's hash is its sign, the others say which component it adds to."""
    dimension = np.uint64(len(total))
    for word_hash in hashes.ravel():
        component = (word_hash >> np.uint64(1)) % dimension
        total[component] += -weight if word_hash & np.uint64(1) else weight


def _window(centre_px: float, spread_px: float) -> tuple[list[int], list[int]]:
    """Return the whole positions nearer than ``spread_px`` and their triangular weights, in half pixels.

    Without spread it is the position itself with its fraction cut off, as `words.sentences` has it.
    """
    if not spread_px:
        return [int(centre_px)], [1]
    reach = round(2 * spread_px)
    positions = range(int(centre_px - spread_px) - 1, int(centre_px + spread_px) + 2)
    weights = {p: reach - round(2 * abs(p - centre_px)) for p in positions}
    return [p for p, w in weights.items() if w > 0], [w for w in weights.values() if w > 0]
