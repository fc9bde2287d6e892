"""Words as integers, against the texts that they stand for."""

import hashlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semrl.perception.embedding import WordsConfig, build_scene_graph, hash_words, sentences, word_hash


@given(st.text(max_size=400), st.integers(0, 2**64 - 1))
def test_a_hash_is_a_salted_digest(word: str, seed: int) -> None:
    digest = hashlib.blake2b(word.encode(), digest_size=8, salt=np.uint64(seed).tobytes()).digest()
    assert word_hash(word, seed) == np.frombuffer(digest, "<u8")[0]


@pytest.mark.parametrize("seed", [0, 7, 2**64 - 1])
@pytest.mark.parametrize("count", [0, 1, 25, 300])
def test_every_word_has_the_hash_of_its_text(count: int, seed: int) -> None:
    rng = np.random.default_rng(count)
    scene = build_scene_graph(rng.integers(-2, 1200, count), rng.uniform(-9, 84, (count, 2)), 20.0)
    for config in (WordsConfig(), WordsConfig(form="pv-dm", wl_iterations=3)):
        texts = sentences(scene, config)
        hashes = hash_words(texts, seed)
        assert hashes.dtype == np.uint64 and len(hashes) == count
        assert hashes.tolist() == [[word_hash(word, seed) for word in text] for text in texts]
