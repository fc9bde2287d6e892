"""An embedding that needs no training: the words of a scene hashed into a vector.

Signed feature hashing (Weinberger, Dasgupta, Langford, Smola and Attenberg, "Feature hashing for large
scale multitask learning", ICML 2009). Inner products of the vectors are, in expectation over the hash
function, those of the scenes' word counts. Nothing is learned, so nothing can drift.
"""

from dataclasses import dataclass, field

import numpy as np

from semrl.core import Floats, Ints, SceneGraph
from semrl.core.errors import UsageError
from semrl.core.kernels import compiled
from semrl.core.memo import Memo
from semrl.perception.embedding.scene_graph import object_keys
from semrl.perception.embedding.unlearned import Unlearned
from semrl.perception.embedding.word_hashes import Hashes, WordHasher
from semrl.perception.embedding.words import WordsConfig

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

    Parameters
    ----------
    config
        Settings; the defaults if none are given.
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
        self._hasher = WordHasher(self.config.words, self.config.seed)
        self._objects = Memo(self._sum_objects, width=3)  # class, doubled row and column → its words' signed sum

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

        Raises
        ------
        DataError
            If a centre is not finite or too far away.
        """
        sums, places = self._objects.look_up(object_keys(graph))
        return sum_scene(sums, places, self._hasher.surroundings(graph), self._hash_weight, self._scale)

    def _sum_objects(self, keys: Ints) -> Ints:
        """Sum the words of each of ``(k, 3)`` objects, ``(k, dimension)``."""
        positions, weights = _window(keys[:, 1:], self.config.spread_px)  # (k, 2, w)
        n, _, width = positions.shape
        places = np.empty((n, width, width, 2), np.int64)
        places[..., 0], places[..., 1] = positions[:, 0, :, None], positions[:, 1, None, :]
        words = self._hasher.places(np.repeat(keys[:, 0], width * width), places.reshape(-1, 2))
        both = (weights[:, 0, :, None] * weights[:, 1, None, :]).reshape(n, width * width)
        return sum_spread(
            words.reshape(n, width * width, words.shape[1]), _ONE * both, self._class_weight, self.dimension
        )


@compiled
def sum_scene(sums: Ints, places: Ints, hashes: Hashes, hash_weight: int, scale: np.float32) -> Floats:
    """Sum what the objects of a scene say, and scale it.

    Parameters
    ----------
    sums, places
        The sums of position words, ``(c, dimension)``, and which of them are those of the ``n`` objects.
    hashes
        ``(n, k)``, of the words about surroundings.
    hash_weight
        Of each of these.
    scale
        What the sum is multiplied with.

    Returns
    -------
    ``(dimension,)`` float32.
    """
    total = np.zeros(sums.shape[1], np.int64)
    for place in places:
        total += sums[place]
    for words in hashes:
        add_words(total, words, hash_weight)
    return total.astype(np.float32) * scale


@compiled
def sum_spread(words: Hashes, weights: Ints, class_weight: int, dimension: int) -> Ints:
    """Sum the position words of objects.

    Parameters
    ----------
    words
        ``(n, p, w)``, of each object at each position around it; the first of them names its class.
    weights
        ``(n, p)``, of all words of a position but the first.
    class_weight
        Of the first word, which counts once.
    dimension
        Length of the vectors.

    Returns
    -------
    ``(n, dimension)`` int64.
    """
    sums = np.zeros((len(words), dimension), np.int64)
    for i in range(len(words)):
        for p in range(words.shape[1]):
            add_words(sums[i], words[i, p, 1:], weights[i, p])
        add_words(sums[i], words[i, 0, :1], class_weight)
    return sums


@compiled
def add_words(total: Ints, hashes: Hashes, weight: int) -> None:
    """Count ``(k,)`` words: the lowest bit of a word's hash is its sign, the others say which component it adds to."""
    dimension = np.uint64(len(total))
    for word_hash in hashes:
        component = (word_hash >> np.uint64(1)) % dimension
        total[component] += -weight if word_hash & np.uint64(1) else weight


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
