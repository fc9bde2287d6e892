"""Graph2vec that learns as it goes: the obstacle that the thesis names (§3.2.3, §5).

Doc2vec keeps a vector for every document and a list of all words, and goes over both many times. Here a document's
vector is a function of its words' vectors, as in Doc2VecC (Chen, "Efficient vector representation for documents through
corruption", ICLR 2017), and words live in hashed buckets, as in fastText (Bojanowski, Grave, Joulin and Mikolov, TACL
2017): each document is seen once, the vocabulary may grow for ever, and memory does not.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Self

import numpy as np

from semrl.core import Floats, Ints, SceneGraph
from semrl.core.arrays import Arrays, array_to_json, json_to_array
from semrl.core.errors import DataError, UsageError
from semrl.perception.embedding.fractional import FractionalEmbedding, FractionalEmbeddingConfig
from semrl.perception.embedding.online_kernels import Memory, Rates, add_vectors, learn, new_memory
from semrl.perception.embedding.words import WordsConfig, hash_words, sentences


@dataclass(frozen=True, kw_only=True, slots=True)
class OnlineEmbeddingConfig:
    """Settings of `OnlineEmbedding`."""

    dimension: int = 128
    """Length of the vectors."""
    documents: int = 5_000
    """Scenes to learn from before the agent begins; then words stay as they are, and no vector drifts."""
    prior: float = 1.0
    """What places as phases count, which need no learning; 0: words alone."""
    width_px: float = 16.0
    """How far apart two places are, in pixels, whose similarity has fallen to exp(−1/2), before learning."""
    words: WordsConfig = field(default_factory=WordsConfig)
    """Which words describe a scene."""
    buckets: int = 1 << 15
    """Words share so many vectors, by their hashes."""
    learning_rate: float = 0.01
    """Learning rate at the first document."""
    halving_documents: int = 2_000
    """Documents after which the learning rate is half of that, then a third, a quarter and so on; 0: it stays."""
    anchor: float = 10.0
    """How strongly words are pulled back to where they began, as a multiple of the learning rate."""
    negative: int = 5
    """Number of noise words of negative sampling."""
    corruption: float = 0.5
    """Share of a scene's objects that are hidden in learning: their words must be told from the others."""
    down_sampling: float = 1e-5
    """Share of the text above which a word is skipped at random as something to be predicted."""
    seed: int = 0
    """Of hash function, noise and skipped words."""

    def __post_init__(self) -> None:
        if min(self.documents, self.buckets, self.negative) < 1:
            raise UsageError("documents, buckets and negative must be 1 or more")
        if not (0 <= self.prior <= 1000 and 0 <= self.corruption < 1):
            raise UsageError("prior must lie in 0 … 1000, corruption from 0 on and below 1")
        if not (0 < self.learning_rate <= 1 and self.halving_documents >= 0 and 0 <= self.anchor < np.inf):
            raise UsageError("learning_rate must lie above 0 and not above 1, halving_documents and anchor not below 0")
        if not 0 < self.down_sampling <= 1:
            raise UsageError(f"down_sampling is a share above 0, at most 1, not {self.down_sampling}")
        if not 0 <= self.seed < 1 << 64:
            raise UsageError(f"seed must lie between 0 and 2^64 - 1, not {self.seed}")
        _places(self)  # has an opinion on dimension and width


class OnlineEmbedding:
    """Embeds a scene as the places of its objects, which need no learning, and its words, which do.

    The vector is ``prior · fractional(scene) + Σ_w v_w / √(words of an object)``: `FractionalEmbedding`, and one
    learned vector for each bucket of words, which begins at zero (at random where there is no prior). As in PV-DBOW
    (Le and Mikolov 2014) a document's vector is to predict which words are in it. It learns that by negative sampling
    (SGNS; Mikolov et al., "Distributed representations of words and phrases and their compositionality", NIPS 2013):
    words of the document get a higher score than noise, and frequent ones are skipped now and then. In one pass over
    an endless text, frequencies and noise are those met so far (Kaji and Kobayashi, "Incremental skip-gram model with
    negative sampling", EMNLP 2017); a bucket's count is a count-min sketch of one row. What is learned is what goes
    with what: objects are hidden at random, and their words told from the others (Chen 2017); else each word would
    only predict itself.

    Three things hold drift down: the prior does not move and fixes the axes of the space, each word is pulled back to
    zero (`anchor`), and the learning rate falls. It is over when nobody calls `partial_fit` any more.

    Attributes
    ----------
    documents_ : int
        Scenes learned from.
    memory_ : Memory or None
        What is known of the words.
    """

    def __init__(self, config: OnlineEmbeddingConfig | None = None) -> None:
        self.config = config or OnlineEmbeddingConfig()
        self.documents_ = 0
        self.memory_: Memory | None = None
        self._places = _places(self.config)
        self._weight = 1 / np.sqrt(max(self.config.words.words_per_object, 1))

    @property
    def documents_needed(self) -> int:
        """How many scenes to learn from before the vectors are used."""
        return self.config.documents

    @property
    def is_fitted(self) -> bool:
        """Whether enough scenes were learned from."""
        return self.documents_ >= self.config.documents

    @property
    def dimension(self) -> int:
        """Length of the vectors."""
        return self.config.dimension

    @property
    def vocabulary_size_(self) -> int:
        """Number of buckets in use, at most the number of distinct words met."""
        return int(np.count_nonzero(self._learned().counts))

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:
        """Learn from scenes, one after the other; what was learned before is forgotten."""
        self.documents_, self.memory_ = 0, None
        for graph in graphs:
            self.partial_fit(graph)
        return self

    def partial_fit(self, graph: SceneGraph) -> Self:
        """Learn from one scene, which is not needed again."""
        # Divided by the root of their number, so that crowded scenes are learned like others.
        crowd = np.float32(1 / np.sqrt(max(len(graph), 1)))
        priors = np.float32(self.config.prior) * crowd * self._places.objects(graph)
        words = self._words(graph)
        if self.memory_ is None:
            self.memory_ = self._new_memory()
        learn(words, priors, self.memory_, self._rates(float(crowd * self._weight)))
        self.documents_ += 1
        return self

    def transform(self, graph: SceneGraph) -> Floats:
        """Embed a scene, ``(dimension,)`` float32: a pure function of its objects and of what was learned."""
        memory = self._learned()
        prior: Floats = np.float32(self.config.prior) * self._places.transform(graph)
        return prior + np.float32(self._weight) * add_vectors(self._words(graph), memory.vectors)

    def to_arrays(self) -> Arrays:
        """Return what is known of the words; nothing if nothing was learned."""
        if self.memory_ is None:
            return {}
        return {
            "settings": json_to_array(asdict(self.config)),
            "documents": np.array(self.documents_),
            **self.memory_._asdict(),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured embedding returned."""
        if not arrays:
            self.documents_, self.memory_ = 0, None
            return
        if array_to_json(arrays["settings"]) != asdict(self.config):
            raise DataError("the arrays of the online embedding were written under other settings than those in use")
        self.documents_ = int(arrays["documents"])
        self.memory_ = Memory(*(arrays[name].copy() for name in Memory._fields))

    def _new_memory(self) -> Memory:
        config = self.config
        start = 0.0 if config.prior else 0.5 / np.sqrt(config.dimension)
        return new_memory(config.buckets, config.dimension, start, config.seed)

    def _rates(self, word_weight: float) -> Rates:
        config = self.config
        halvings = self.documents_ / config.halving_documents if config.halving_documents else 0.0
        return Rates(
            learning_rate=config.learning_rate / (1 + halvings),
            anchor=config.anchor,
            down_sampling=config.down_sampling,
            negative=config.negative,
            corruption=config.corruption,
            word_weight=word_weight,
        )

    def _words(self, graph: SceneGraph) -> Ints:
        """Return the bucket of each word, ``(n, words_per_object)``."""
        hashes = hash_words(sentences(graph, self.config.words), self.config.seed)
        buckets: Ints = (hashes % np.uint64(self.config.buckets)).astype(np.int64)
        return buckets

    def _learned(self) -> Memory:
        if self.memory_ is None:
            raise UsageError("the online embedding has learned nothing yet: call partial_fit with scenes first")
        return self.memory_


def _places(config: OnlineEmbeddingConfig) -> FractionalEmbedding:
    return FractionalEmbedding(
        FractionalEmbeddingConfig(dimension=config.dimension, width_px=config.width_px, seed=config.seed)
    )
