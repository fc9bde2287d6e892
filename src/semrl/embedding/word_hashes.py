"""Scenes as integers: each word's hash of 64 bits stands for the word, so that no text is written on the way."""

import hashlib

import numpy as np
from numpy.typing import NDArray

from semrl.embedding.neighbourhoods import hash_texts, neighbourhood_labels
from semrl.embedding.words import WordsConfig, position_words
from semrl.memo import Memo
from semrl.types import Ints, SceneGraph

Hashes = NDArray[np.uint64]


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
        width = self.config.words_per_object - self.config.wl_iterations
        hashes = np.empty((len(keys), width), np.uint64)
        for row, (number, x, y) in zip(hashes, keys.tolist(), strict=True):
            row[:] = [word_hash(word, self.seed) for word in position_words(number, x, y, self.config)]
        return hashes
