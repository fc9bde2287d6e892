"""The thesis's own embedding (§3.2.3): gensim's Doc2Vec over the words of a scene.

Le and Mikolov, "Distributed representations of sentences and documents", ICML 2014. Gensim is an extra:
``pip install gensim``.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from typing import Any, Self

import numpy as np

from semrl.core import Floats, SceneGraph
from semrl.core.arrays import Arrays, array_to_json, json_to_array
from semrl.core.errors import DataError, MissingExtraError, UsageError
from semrl.perception.embedding.doc2vec_kernels import Tree, infer, tree_of
from semrl.perception.embedding.words import WordsConfig, document


@dataclass(frozen=True, kw_only=True, slots=True)
class Doc2VecConfig:
    """Settings of `Doc2VecEmbedding`: the parameters of §3.2.3 with the thesis's values."""

    documents: int = 30_000
    """Number of scenes to gather before training."""
    dimension: int = 128
    """Length of the vectors."""
    min_count: int = 2
    """How often a word must occur in all scenes together to be used."""
    epochs: int = 20
    """Passes over the scenes in training, and over the one scene when its vector is inferred."""
    learning_rate: float = 0.025
    """Learning rate at the start of training and of inferring; it falls linearly to 0.0001."""
    window_words: int = 16
    """PV-DM: the largest distance of context and predicted word, in words."""
    hierarchical_softmax: bool = True
    """Whether to predict words down a Huffman tree."""
    words: WordsConfig = field(default_factory=WordsConfig)
    """Which words describe a scene; their form selects the algorithm, PV-DBOW or PV-DM."""
    negative: int = 0
    """Number of noise words of negative sampling; 0 for none."""
    max_vocabulary_words: int = 30_000
    """When more distinct words than this were seen, the rarest are dropped."""
    down_sampling: float = 1e-4
    """Share of the text above which a word is skipped at random; 0 never skips. Karate Club's value."""
    seed: int = 0
    """Seed of first weights, skipped words and noise words."""

    def __post_init__(self) -> None:
        for name in ("documents", "dimension", "min_count", "epochs", "window_words", "max_vocabulary_words"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} must be 1 or more, not {getattr(self, name)}")
        if not self.learning_rate > 0 or not self.down_sampling >= 0 or self.negative < 0:
            raise UsageError("learning_rate must be above 0, down_sampling and negative must not be below 0")
        if not self.hierarchical_softmax and self.negative < 1:
            raise UsageError("doc2vec learns by hierarchical_softmax, by negative sampling or by both, not by neither")
        if not 0 <= self.seed < 1 << 32:
            raise UsageError(f"seed must lie between 0 and 2^32 - 1, not {self.seed}")


class Doc2VecEmbedding:
    """Embeds a scene by PV-DBOW or PV-DM, trained once on many scenes.

    Two things gensim leaves to chance are settled here, so that a vector is a function of scene and
    model: one worker trains, and each inference starts from the same random state and from a first
    vector drawn by a hash of our own. (Gensim's ``infer_vector`` goes on with a generator it shares with
    all calls before, and draws by Python's ``hash``, which differs between processes.)

    Raises
    ------
    MissingExtraError
        If gensim is not installed.
    """

    def __init__(self, config: Doc2VecConfig | None = None) -> None:
        self.config = config or Doc2VecConfig()
        self.model_: Any = None  # a gensim Doc2Vec
        self._tree: Tree | None = None  # of PV-DBOW without negative sampling, which is inferred in compiled code
        if find_spec("gensim") is None:  # now, not after 30,000 scenes have been gathered
            raise MissingExtraError("thesis", "the doc2vec embedding (gensim)")

    @property
    def documents_needed(self) -> int:
        """How many scenes to gather for `fit`."""
        return self.config.documents

    @property
    def is_fitted(self) -> bool:
        """Whether the model was trained."""
        return self.model_ is not None

    @property
    def dimension(self) -> int:
        """Length of the vectors."""
        return self.config.dimension

    @property
    def vocabulary_size_(self) -> int:
        """Number of distinct words in use (§4.1.3: 9,277)."""
        return len(self._fitted().wv)

    @property
    def document_vectors_(self) -> Floats:
        """The vectors of the scenes of `fit`, ``(documents, dimension)`` float32 (§4.1.3)."""
        vectors: Floats = self._fitted().dv.vectors.copy()
        return vectors

    def fit(self, graphs: Sequence[SceneGraph]) -> Self:
        """Train on scenes, all at once; what was learned before is forgotten.

        Parameters
        ----------
        graphs
            The scenes; usually `documents_needed` of them, but any number will do.

        Raises
        ------
        DataError
            If fewer than two words occur often enough.
        """
        from gensim.models.doc2vec import TaggedDocument

        texts = [TaggedDocument(document(graph, self.config.words), [i]) for i, graph in enumerate(graphs)]
        model = self._new_model()
        if texts:
            model.scan_vocab(texts)
            model.prepare_vocab()
        if len(model.wv) < 2:  # gensim's Huffman tree needs two leaves
            raise DataError(f"doc2vec needs two words that occur {self.config.min_count} times in {len(texts)} scenes")
        model.prepare_weights()
        model.train(texts, total_examples=len(texts), epochs=self.config.epochs)
        self._take(model)
        return self

    def transform(self, graph: SceneGraph) -> Floats:
        """Infer the vector of a scene, ``(dimension,)`` float32; see `infer_words`."""
        return self.infer_words(document(graph, self.config.words))

    def infer_words(self, words: list[str]) -> Floats:
        """Infer the vector of a scene's words, ``(dimension,)`` float32; those not in the vocabulary are left out."""
        from gensim.models.keyedvectors import pseudorandom_weak_vector

        model = self._fitted()
        if not words:
            return np.zeros(self.dimension, dtype=np.float32)
        vector: Floats = pseudorandom_weak_vector(self.dimension, seed_string=" ".join(words), hashfxn=_stable_hash)
        if self._tree is None:
            self._infer_by_gensim(words, vector)
        else:
            known = model.wv.key_to_index
            numbers = np.array([known[word] for word in words if word in known], np.int64)
            infer(numbers, self._tree, self._rates, self._chances, model.sample > 0, vector)
        return vector

    def _infer_by_gensim(self, words: list[str], vector: Floats) -> None:
        """Learn the vector of a scene in place: by PV-DM, or with negative sampling."""
        from gensim.models import doc2vec

        model = self.model_
        train = doc2vec.train_document_dbow if model.sg else doc2vec.train_document_dm
        model.random.seed(self.config.seed)
        vectors = vector.reshape(1, -1)
        for rate in self._rates.tolist():
            train(
                model, words, [0], rate, learn_words=False, learn_hidden=False,
                doctag_vectors=vectors, doctags_lockf=np.ones(1, dtype=np.float32),
            )  # fmt: skip

    def to_arrays(self) -> Arrays:
        """Return vocabulary, weights and document vectors; nothing if nothing was learned."""
        if self.model_ is None:
            return {}
        arrays: Arrays = {"settings": json_to_array(asdict(self.config))}
        arrays["words"] = json_to_array(self.model_.wv.index_to_key)
        for name, owner, key in self._arrays_of(self.model_):
            arrays[name] = np.array(owner[key])
        return arrays

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured embedding returned."""
        if not arrays:
            self.model_ = self._tree = None
            return
        if array_to_json(arrays["settings"]) != asdict(self.config):
            raise DataError("the doc2vec arrays were written under other settings than those in use")
        model = self._new_model()
        words = array_to_json(arrays["words"])
        model.wv.index_to_key = words
        model.wv.key_to_index = {word: i for i, word in enumerate(words)}
        model.dv.index_to_key = list(range(len(arrays["document_vectors"])))
        model.init_weights()  # gives all arrays their shapes
        for name, owner, key in self._arrays_of(model):
            owner[key] = arrays[name].copy()
        if model.hs:
            model.create_binary_tree()  # the Huffman tree follows from order and counts of the words
        self._take(model)

    def _take(self, model: Any) -> None:
        """Use a trained model, and prepare what all inferences have in common."""
        self.model_ = model
        self._rates = np.linspace(model.alpha, model.min_alpha, self.config.epochs)
        model.random.seed(self.config.seed)
        self._chances = np.array(
            [(model.random.randint(0, 1 << 24) << 24) + model.random.randint(0, 1 << 24) for _ in self._rates],
            np.uint64,
        )
        words = model.wv.expandos
        by_tree = model.sg and model.hs and not model.negative
        self._tree = tree_of(model.syn1, words["point"], words["code"], words["sample_int"]) if by_tree else None

    def _new_model(self) -> Any:
        from gensim.models.doc2vec import Doc2Vec

        config = self.config
        return Doc2Vec(
            dm=int(config.words.form == "pv-dm"),
            vector_size=config.dimension,
            min_count=config.min_count,
            epochs=config.epochs,
            alpha=config.learning_rate,
            window=config.window_words,
            hs=int(config.hierarchical_softmax),
            negative=config.negative,
            max_vocab_size=config.max_vocabulary_words,
            sample=config.down_sampling,
            seed=config.seed,
            hashfxn=_stable_hash,
            workers=1,
        )

    def _arrays_of(self, model: Any) -> Iterator[tuple[str, dict[str, Any], str]]:
        """Yield the model's arrays as (our name, the dictionary that holds it, its key there)."""
        yield "counts", model.wv.expandos, "count"
        yield "sampling", model.wv.expandos, "sample_int"
        yield "document_vectors", vars(model.dv), "vectors"
        if model.dm:  # PV-DBOW has no word vectors to learn
            yield "word_vectors", vars(model.wv), "vectors"
        if model.hs:
            yield "tree_weights", vars(model), "syn1"
        if model.negative:
            yield "noise_weights", vars(model), "syn1neg"
            yield "noise_table", vars(model), "cum_table"

    def _fitted(self) -> Any:
        if self.model_ is None:
            raise UsageError("the doc2vec embedding has learned nothing yet: call fit with scenes first")
        return self.model_


def _stable_hash(text: str) -> int:
    """Hash a text to 32 bits, alike in every process."""
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "little")
