"""An embedding that needs no training: the words of a scene hashed into a vector.

Signed feature hashing (Weinberger, Dasgupta, Langford, Smola and Attenberg, "Feature hashing for large
scale multitask learning", ICML 2009). Inner products of the vectors are, in expectation over the hash
function, those of the scenes' word counts. Nothing is learned, so nothing can drift.
"""

from dataclasses import dataclass, field

import numpy as np

from semrl.core import Floats, Ints, SceneGraph
from semrl.core.errors import UsageError
from semrl.core.memo import Memo
from semrl.perception.embedding.scene_graph import object_keys
from semrl.perception.embedding.unlearned import Unlearned
from semrl.perception.embedding.words import Hashes, WordsConfig, hash_words, position_words, wl_hashes

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


class HashedEmbedding(Unlearned):
    """Embeds a scene as the signed sum of its hashed words.

    Every word adds +1 or −1 to one component; its hash says which. The sum is divided by the root of the
    number of words an object has, which gives one object the expected length 1. This factor is the same
    for all scenes, unlike a norm: moving one object changes the vector by the same amount whatever else
    is in the picture, and the inputs of a network stay of the order of 1.

    Words of neighbouring positions have nothing in common, so an object that moves by a pixel looks like
    another object. With ``spread_px`` an object also says, less loudly, the words of the positions around
    it: its vector is the mean of theirs under a triangular window, a smooth function of its centre, to
    half a pixel.
    """

    def __init__(self, config: HashedEmbeddingConfig | None = None) -> None:
        self.config = config or HashedEmbeddingConfig()
        super().__init__(self.config.dimension)
        _, window = _window(np.array(0), self.config.spread_px)
        # A word that names one coordinate is met at every position of the other: its spread copies have this length.
        length = float(np.sqrt((window**2).sum()) * window.sum())
        self._class_weight = round(_ONE * length)
        self._hash_weight = round(_ONE * length * self.config.neighbourhood_weight)
        self._scale = np.float32(1 / (_ONE * length * np.sqrt(max(self.config.words.words_per_object, 1))))
        self._objects = Memo(self._sum_objects, width=3)  # class, doubled row and column → its words' signed sum

    def transform(self, graph: SceneGraph) -> Floats:
        """Embed a scene, ``(dimension,)`` float32: a pure function of it, the same bits in every process.

        Words are counted as integers, so the order of the sum does not matter, and scaled once.
        """
        sums, places = self._objects.look_up(object_keys(graph))
        total = sums[places].sum(axis=0)
        around = wl_hashes(graph, self.config.words.wl_iterations)
        _add_words(total, hash_words(around, self.config.seed), np.int64(self._hash_weight))
        vector: Floats = total.astype(np.float32) * self._scale
        return vector

    def _sum_objects(self, keys: Ints) -> Ints:
        """Sum the words of each of ``(k, 3)`` objects, ``(k, dimension)``: that of its class once, others by window."""
        positions, weights = _window(keys[:, 1:], self.config.spread_px)  # (k, 2, w)
        sums = np.zeros((len(keys), self.dimension), np.int64)
        for total, number, (rows, columns), (by_row, by_column) in zip(
            sums, keys[:, 0].tolist(), positions.tolist(), weights, strict=True
        ):
            words = [position_words(number, r, c, self.config.words) for r in rows for c in columns]
            hashes = hash_words(words, self.config.seed)
            _add_words(total, hashes[:, 1:], _ONE * np.outer(by_row, by_column).reshape(-1, 1))
            _add_words(total, hashes[0, :1], np.int64(self._class_weight))
        return sums


def _add_words(total: Ints, hashes: Hashes, weights: Ints | np.int64) -> None:
    """Count words: the lowest bit of a word's hash is its sign, the others say which component it adds to."""
    components = (hashes >> np.uint64(1)) % np.uint64(len(total))
    np.add.at(total, components.astype(np.int64), np.where(hashes & np.uint64(1), -weights, weights))


def _window(halves: Ints, spread_px: float) -> tuple[Ints, Ints]:
    """Return whole positions around coordinates and their triangular weights, in half pixels.

    Parameters
    ----------
    halves
        ``(...,)`` coordinates in half pixels.
    spread_px
        Positions nearer than this weigh more than 0. Without spread it is the position itself with its fraction
        cut off, as `words.sentences` has it.

    Returns
    -------
    positions, weights
        Each ``(..., w)`` int64.
    """
    if not spread_px:
        positions = np.fix(halves / 2).astype(np.int64)[..., None]
        return positions, np.ones_like(positions)
    reach = round(2 * spread_px)
    positions = (halves // 2)[..., None] + np.arange(-(reach // 2), reach // 2 + 1)
    return positions, np.maximum(reach - np.abs(2 * positions - halves[..., None]), 0)
