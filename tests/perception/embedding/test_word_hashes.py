"""Words as integers, against the texts that they stand for."""

import hashlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semrl.core import SceneGraph
from semrl.perception.embedding import WordHasher, WordsConfig, build_scene_graph, sentences, word_hash
from semrl.perception.embedding.blake2 import blake2b


def random_scene(seed: int, count: int) -> SceneGraph:
    rng = np.random.default_rng(seed)
    return build_scene_graph(rng.integers(-2, 1200, count), rng.uniform(-9, 84, (count, 2)), 20.0)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # machines are busy now and then
@given(st.binary(max_size=400), st.integers(0, 2**64 - 1), st.sampled_from([8, 16, 64]))
def test_compiled_digests_are_those_of_the_standard_library(message: bytes, salt: int, size: int) -> None:
    ours = blake2b(np.frombuffer(message, np.uint8), size, np.uint64(salt)).astype("<u8").tobytes()[:size]
    assert ours == hashlib.blake2b(message, digest_size=size, salt=salt.to_bytes(8, "little")).digest()


@pytest.mark.parametrize("length", [0, 1, 127, 128, 129, 255, 256, 257])
def test_blocks_end_where_they_must(length: int) -> None:
    message = np.arange(length).astype(np.uint8)
    ours = blake2b(message, 64, np.uint64(0)).astype("<u8").tobytes()
    assert ours == hashlib.blake2b(message.tobytes()).digest()


@pytest.mark.parametrize("seed", [0, 7, 2**64 - 1])
@pytest.mark.parametrize("count", [0, 1, 25, 300])
def test_every_word_has_the_hash_of_its_text(count: int, seed: int) -> None:
    scene = random_scene(count, count)
    for config in (WordsConfig(), WordsConfig(form="pv-dm", wl_iterations=3), WordsConfig(wl_iterations=0)):
        hashes = WordHasher(config, seed).sentences(scene)
        assert (hashes.dtype, hashes.shape) == (np.uint64, (count, config.words_per_object))
        assert hashes.tolist() == [[word_hash(word, seed) for word in text] for text in sentences(scene, config)]


def test_what_was_remembered_changes_nothing() -> None:
    hasher = WordHasher(WordsConfig())
    scenes = [random_scene(seed, 20) for seed in range(4)]
    first = [hasher.sentences(scene) for scene in scenes]
    for scene, before in zip(reversed(scenes), reversed(first), strict=True):
        np.testing.assert_array_equal(hasher.sentences(scene), before)
