"""Scenes as integers: each word's hash of 64 bits stands for the word, so that no text is written on the way."""

import hashlib
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints, SceneGraph
from semrl.core.kernels import compiled
from semrl.core.memo import Memo
from semrl.perception.embedding.blake2 import blake2b
from semrl.perception.embedding.neighbourhoods import LABEL_BYTES, hash_texts, neighbourhood_labels, write_number
from semrl.perception.embedding.words import PIECES, POSITION_WORDS, WordsConfig

Hashes = NDArray[np.uint64]

_NAMES = np.array([list(name.encode().ljust(LABEL_BYTES, b"\0")) for name in PIECES], np.uint8)  # (5, 32)
_NAME_LENGTHS = np.array([len(name) for name in PIECES])
_NO_PIECE = -1


def word_hash(word: str, seed: int = 0) -> int:
    """Hash one word to 64 bits: BLAKE2b, alike in every process; the seed selects the function."""
    digest = hashlib.blake2b(word.encode(), digest_size=8, salt=seed.to_bytes(8, "little")).digest()
    return int.from_bytes(digest, "little")


class WordHasher:
    """Writes scenes as the hashes of their words.

    A pure function of the scene, the configuration and the seed: the same bits in every process. What an object
    says of its class and place is remembered, which changes nothing but the time.

    Parameters
    ----------
    config
        Which words describe a scene.
    seed
        Selects the hash function, from 0 to 2⁶⁴ − 1.
    """

    def __init__(self, config: WordsConfig, seed: int = 0) -> None:
        self.config = config
        self.seed = seed
        self._places = Memo(self._hash_places, width=3)

    def sentences(self, graph: SceneGraph) -> Hashes:
        """Write a scene of ``n`` objects, ``(n, config.words_per_object)`` uint64.

        Row ``i`` is about the object at ``graph.centres_px[i]`` and has the words of `words.sentences` in their
        order, each as its `word_hash`. So a column holds one sort of word: 0 the class, the last
        ``wl_iterations`` of them the surroundings.
        """
        whole = graph.centres_px.astype(np.int64)  # cuts off the fraction
        return np.concatenate([self.places(graph.classes, whole), self.surroundings(graph)], axis=1)

    def places(self, classes: Ints, places_px: Ints) -> Hashes:
        """Hash the `position_words` of objects of ``(n,)`` classes at ``(n, 2)`` whole pixels."""
        hashes, found = self._places.look_up(np.column_stack([classes, places_px]))
        return hashes[found]

    def surroundings(self, graph: SceneGraph) -> Hashes:
        """Hash the `wl_hashes` of a scene, ``(n, wl_iterations)``."""
        labels = neighbourhood_labels(graph, self.config.wl_iterations)
        return hash_texts(labels, np.uint64(self.seed))

    def _hash_places(self, keys: Ints) -> Hashes:
        near = keys[:, 1:] // self.config.coarse_px
        numbers = np.concatenate([keys, near], axis=1)  # (k, 5) one for each piece
        return hash_pieces(numbers, _words_as_array(self.config.form), np.uint64(self.seed))


@cache
def _words_as_array(form: str) -> Ints:
    """Return the pieces of each position word, ``(w, 4)``, filled up with −1."""
    words = POSITION_WORDS[form]
    longest = max(len(word) for word in words)
    return np.array([[*word, *[_NO_PIECE] * (longest - len(word))] for word in words])


@compiled
def hash_pieces(numbers: Ints, words: Ints, salt: np.uint64) -> Hashes:
    """Put words together from pieces, a name and a number each, and hash them.

    Parameters
    ----------
    numbers
        ``(k, 5)``, of each of `PIECES`, for ``k`` objects.
    words
        ``(w, p)``, the pieces of each word, −1 for none.
    salt
        Selects the hash function.

    Returns
    -------
    ``(k, w)`` uint64.
    """
    hashes = np.empty((len(numbers), len(words)), np.uint64)
    pieces = np.zeros((len(_NAMES), 2 * LABEL_BYTES), np.uint8)
    pieces[:, :LABEL_BYTES] = _NAMES
    lengths = np.empty(len(_NAMES), np.int64)
    word = np.empty(pieces.shape[1] * words.shape[1], np.uint8)
    for i in range(len(numbers)):
        for piece in range(len(_NAMES)):
            start = _NAME_LENGTHS[piece]
            lengths[piece] = start + write_number(numbers[i, piece], pieces[piece, start:])
        for j in range(len(words)):
            end = 0
            for piece in words[j]:
                if piece != _NO_PIECE:
                    word[end : end + lengths[piece]] = pieces[piece, : lengths[piece]]
                    end += lengths[piece]
            hashes[i, j] = blake2b(word[:end], 8, salt)[0]
    return hashes
