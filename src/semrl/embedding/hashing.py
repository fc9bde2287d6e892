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
from semrl.types import Floats, SceneGraph

_CACHE_ENTRIES = 1 << 15
"""Entries at which a cache is emptied; Pong needs about 3,000."""


@dataclass(frozen=True, kw_only=True, slots=True)
class HashedEmbeddingConfig:
    """Settings of `HashedEmbedding`."""

    dimension: int = 128
    """Length of the vectors."""

    words: WordsConfig = field(default_factory=WordsConfig)
    """Which words describe a scene."""

    seed: int = 0
    """Selects the hash function, from 0 on."""

    def __post_init__(self) -> None:
        if self.dimension < 1:
            raise UsageError(f"dimension must be 1 or more, not {self.dimension}")
        if not 0 <= self.seed < 1 << 64:
            raise UsageError(f"seed must lie between 0 and 2^64 - 1, not {self.seed}")


class HashedEmbedding:
    """Embeds a scene as the signed sum of its hashed words.

    Every word adds +1 or −1 to one component; its hash says which. The sum is divided by the root of the
    number of words an object has, which gives one object the expected length 1. This factor is the same
    for all scenes, unlike a norm: moving one object changes the vector by the same amount whatever else
    is in the picture, and the inputs of a network stay of the order of 1.

    Parameters
    ----------
    config
        Settings; the defaults if none are given.
    """

    def __init__(self, config: HashedEmbeddingConfig | None = None) -> None:
        self.config = config or HashedEmbeddingConfig()
        self._scale = np.float32(1 / np.sqrt(max(self.config.words.words_per_object, 1)))
        self._salt = self.config.seed.to_bytes(8, "little")
        # Slots as bytes: joining them and counting once is several times faster than adding vectors.
        self._position_slots: dict[tuple[int, int, int], bytes] = {}
        self._hash_slots: dict[str, bytes] = {}

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
        counts = np.bincount(np.frombuffer(b"".join(self._slots(graph)), dtype=np.int64), minlength=2 * self.dimension)
        signed = counts[: self.dimension] - counts[self.dimension :]  # (dimension,) int64
        return signed.astype(np.float32) * self._scale

    def to_arrays(self) -> Arrays:
        """Return nothing: there is no state."""
        return {}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over nothing."""

    def _slots(self, graph: SceneGraph) -> list[bytes]:
        if max(len(self._position_slots), len(self._hash_slots)) > _CACHE_ENTRIES:
            self._position_slots.clear()
            self._hash_slots.clear()
        parts = []
        places = graph.centres_px.astype(int).tolist()  # cuts off the fraction, as `words.sentences` does
        for number, (row, column) in zip(graph.classes.tolist(), places, strict=True):
            place = (number, row, column)
            slots = self._position_slots.get(place)
            if slots is None:
                slots = b"".join(map(self._slot, position_words(*place, self.config.words)))
                self._position_slots[place] = slots
            parts.append(slots)
        for words in wl_hashes(graph, self.config.words.wl_iterations):
            for word in words:
                slots = self._hash_slots.get(word)
                if slots is None:
                    slots = self._hash_slots[word] = self._slot(word)
                parts.append(slots)
        return parts

    def _slot(self, word: str) -> bytes:
        """Return where a word counts, as int64 bytes: its index, plus ``dimension`` if its sign is −1."""
        digest = hashlib.blake2b(word.encode(), digest_size=8, salt=self._salt).digest()
        index, negative = divmod(int.from_bytes(digest, "little"), 2)
        slot = index % self.dimension + self.dimension * negative
        return np.int64(slot).tobytes()
