"""An embedding that needs no training: the words of a scene hashed into a vector.

Signed feature hashing (Weinberger, Dasgupta, Langford, Smola and Attenberg, "Feature hashing for large
scale multitask learning", ICML 2009). Inner products of the vectors are, in expectation over the hash
function, those of the scenes' word counts. Nothing is learned, so nothing can drift.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from semrl.arrays import Arrays
from semrl.embedding.words import WordsConfig, position_words, wl_hashes
from semrl.errors import UsageError
from semrl.types import Floats, Ints, SceneGraph

MAX_SPREAD_PX = 32.0

_CACHE_ENTRIES = 1 << 15
"""Entries at which a cache is emptied; Pong needs about 3,000."""

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
        self._salt = self.config.seed.to_bytes(8, "little")
        self._objects: dict[tuple[int, float, float], Ints] = {}  # class, row, column → its words' signed sum
        self._words: dict[str, int] = {}  # word → component, plus dimension if its sign is −1

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
        if len(self._objects) > _CACHE_ENTRIES:
            self._objects.clear()
        hashes = [word for words in wl_hashes(graph, self.config.words.wl_iterations) for word in words]
        total = self._hash_weight * self._count(hashes)
        centres = (graph.centres_px * 2).round() / 2
        for number, (row, column) in zip(graph.classes.tolist(), centres.tolist(), strict=True):
            place = (number, row, column)
            vector = self._objects.get(place)
            if vector is None:
                vector = self._objects[place] = self._object(*place)
            total += vector
        return total.astype(np.float32) * self._scale

    def to_arrays(self) -> Arrays:
        """Return nothing: there is no state."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""

    def _object(self, number: int, row: float, column: float) -> Ints:
        """Sum the words of an object, those of its position spread over the neighbouring ones."""
        rows, row_weights = _window(row, self.config.spread_px)
        columns, column_weights = _window(column, self.config.spread_px)
        total = np.zeros(self.dimension, dtype=np.int64)
        for r, row_weight in zip(rows, row_weights, strict=True):
            for c, column_weight in zip(columns, column_weights, strict=True):
                words = position_words(number, r, c, self.config.words)
                total += _ONE * row_weight * column_weight * self._count(words[1:])
        return total + self._class_weight * self._count((str(number),))

    def _count(self, words: Sequence[str]) -> Ints:
        """Return the signed sum of hashed words, ``(dimension,)``."""
        if len(self._words) > _CACHE_ENTRIES:
            self._words.clear()
        slots = []
        for word in words:
            slot = self._words.get(word)
            if slot is None:
                slot = self._words[word] = self._slot(word)
            slots.append(slot)
        counts = np.bincount(np.array(slots, dtype=np.int64), minlength=2 * self.dimension)
        return counts[: self.dimension] - counts[self.dimension :]

    def _slot(self, word: str) -> int:
        """Return where a word counts: its component, plus ``dimension`` if its sign is −1."""
        digest = hashlib.blake2b(word.encode(), digest_size=8, salt=self._salt).digest()
        index, negative = divmod(int.from_bytes(digest, "little"), 2)
        return index % self.dimension + self.dimension * negative


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
