import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from semrl.core import SceneGraph, memo
from semrl.core.errors import DataError, UsageError
from semrl.core.protocols import Persistent
from semrl.perception.embedding import HashedEmbedding, HashedEmbeddingConfig, WordsConfig, build_scene_graph, document


def random_scene(seed: int, count: int = 25, offset_px: float = 0.0) -> SceneGraph:
    rng = np.random.default_rng(seed)
    return build_scene_graph(rng.integers(0, 5, count), rng.uniform(0, 84, (count, 2)) + offset_px, 20.0)


def together(first: SceneGraph, second: SceneGraph) -> SceneGraph:
    classes = np.concatenate([first.classes, second.classes])
    return build_scene_graph(classes, np.concatenate([first.centres_px, second.centres_px]), 20.0)


def test_it_offers_what_an_embedder_must() -> None:
    embedding = HashedEmbedding(HashedEmbeddingConfig(dimension=32))
    assert isinstance(embedding, Persistent)
    assert (embedding.documents_needed, embedding.dimension) == (0, 32)
    assert embedding.fit([]) is embedding
    assert embedding.to_arrays() == {}
    embedding.from_arrays({})
    vector = embedding.transform(random_scene(0))
    assert (vector.shape, vector.dtype) == ((32,), np.float32)


def test_the_same_bits_in_every_process() -> None:
    code = (
        "import numpy as np; from semrl.perception.embedding import *\n"
        "rng = np.random.default_rng(3)\n"
        "scene = build_scene_graph(rng.integers(0, 5, 25), rng.uniform(0, 84, (25, 2)), 20.0)\n"
        "print(HashedEmbedding().transform(scene).tobytes().hex())"
    )
    for seed in ("1", "2"):
        run = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        )
        assert run.stdout.strip() == HashedEmbedding().transform(random_scene(3)).tobytes().hex()


def test_caches_and_what_came_before_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = [random_scene(seed) for seed in range(10)]
    fresh = [HashedEmbedding().transform(scene) for scene in scenes]
    warm = HashedEmbedding()
    for _ in range(2):
        np.testing.assert_array_equal([warm.transform(scene) for scene in scenes], fresh)
    monkeypatch.setattr(memo, "MOST_ENTRIES", 20)
    crowded = HashedEmbedding()  # its memos overflow at every scene
    np.testing.assert_array_equal([crowded.transform(scene) for scene in scenes], fresh)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(warm)).transform(scenes[0]), fresh[0])


def test_the_order_of_objects_does_not_matter_to_the_last_bit() -> None:
    scene = random_scene(4)
    order = np.random.default_rng(0).permutation(len(scene))
    other = build_scene_graph(scene.classes[order], scene.centres_px[order], 20.0)
    np.testing.assert_array_equal(HashedEmbedding().transform(scene), HashedEmbedding().transform(other))


def test_scenes_out_of_each_others_reach_add_up() -> None:
    embedding = HashedEmbedding()
    first, second = random_scene(1), random_scene(2, offset_px=200.0)
    both = embedding.transform(together(first, second))
    np.testing.assert_allclose(both, embedding.transform(first) + embedding.transform(second), rtol=1e-6, atol=1e-6)


def test_scenes_within_reach_add_up_but_for_their_hashes() -> None:
    embedding = HashedEmbedding(HashedEmbeddingConfig(words=WordsConfig(wl_iterations=0)))
    first, second = random_scene(1), random_scene(2)
    both = embedding.transform(together(first, second))
    np.testing.assert_allclose(both, embedding.transform(first) + embedding.transform(second), rtol=1e-6, atol=1e-6)


def test_no_objects_give_zeros() -> None:
    nothing = build_scene_graph(np.zeros(0, dtype=int), np.zeros((0, 2)), 20.0)
    vector = HashedEmbedding().transform(nothing)
    assert vector.dtype == np.float32
    np.testing.assert_array_equal(vector, np.zeros(128))


def test_what_is_not_finite_is_refused() -> None:
    broken = random_scene(0)
    broken.centres_px[3, 0] = np.nan
    with pytest.raises(DataError):
        HashedEmbedding().transform(broken)


def test_different_scenes_have_different_vectors_and_close_ones_close_vectors() -> None:
    centres = np.random.default_rng(0).uniform(0, 84, (25, 2))
    moved, far = centres.copy(), centres[::-1]
    moved[0] += 1
    classes = np.arange(25) % 5
    embed = HashedEmbedding().transform
    here, near, away = (embed(build_scene_graph(classes, place, 20.0)) for place in (centres, moved, far))
    assert 0 < np.linalg.norm(here - near) < np.linalg.norm(here - away)


def test_inner_products_are_those_of_the_word_counts_on_average() -> None:
    # Weinberger et al. 2009, lemma 2: the hashed inner product is unbiased over hash functions.
    first, second = random_scene(1, 6), random_scene(2, 6)
    config = WordsConfig()
    a, b = document(first, config), document(second, config)
    exact = sum(a.count(word) * b.count(word) for word in set(a)) / config.words_per_object
    products = []
    for seed in range(150):
        embedding = HashedEmbedding(HashedEmbeddingConfig(dimension=256, seed=seed))
        products.append(float(embedding.transform(first) @ embedding.transform(second)))
    error = np.std(products) / np.sqrt(len(products))
    assert abs(np.mean(products) - exact) < 4 * error


def test_one_object_has_the_expected_length_one() -> None:
    scene = build_scene_graph(np.array([8]), np.array([[4.0, 21.0]]), 20.0)
    squares = [
        float(np.sum(HashedEmbedding(HashedEmbeddingConfig(seed=seed)).transform(scene) ** 2)) for seed in range(100)
    ]
    assert np.mean(squares) == pytest.approx(1, abs=0.1)


def test_the_form_of_the_words_matters() -> None:
    scene = random_scene(0)
    plain = HashedEmbedding(HashedEmbeddingConfig(words=WordsConfig(form="pv-dm")))
    assert not np.array_equal(plain.transform(scene), HashedEmbedding().transform(scene))


def one_object(row: float, column: float = 40.0) -> SceneGraph:
    return build_scene_graph(np.array([2]), np.array([[row, column]]), 20.0)


def test_spread_words_make_near_positions_near() -> None:
    alone, spread = (HashedEmbedding(HashedEmbeddingConfig(spread_px=px)).transform for px in (0.0, 6.0))
    steps = [0.5, 1, 2, 4, 8]
    distances = [float(np.linalg.norm(spread(one_object(40 + d)) - spread(one_object(40)))) for d in steps]
    assert distances == sorted(distances) and distances[0] > 0
    jump = np.linalg.norm(alone(one_object(41)) - alone(one_object(40)))
    assert distances[1] < 0.5 * jump < distances[-1]


def test_a_spread_object_is_the_weighted_sum_of_its_neighbours() -> None:
    config = WordsConfig(wl_iterations=0)
    spread = HashedEmbedding(HashedEmbeddingConfig(spread_px=1.0, words=config)).transform
    alone = HashedEmbedding(HashedEmbeddingConfig(words=config)).transform
    # Half-way between two rows both get the same weight, so the difference to the next half-way point is
    # that of the outer rows; the class word cancels.
    left = spread(one_object(10.5)) - spread(one_object(11.5))
    right = alone(one_object(10)) - alone(one_object(12))
    assert np.dot(left, right) / np.linalg.norm(left) / np.linalg.norm(right) == pytest.approx(1, abs=1e-5)


def test_the_neighbourhood_can_count_less_or_nothing() -> None:
    scene = random_scene(0)
    none, words_only = (
        HashedEmbedding(HashedEmbeddingConfig(neighbourhood_weight=weight, words=WordsConfig(wl_iterations=n)))
        for weight, n in ((0.0, 2), (1.0, 0))
    )
    a, b = none.transform(scene), words_only.transform(scene)
    assert np.dot(a, b) / np.linalg.norm(a) / np.linalg.norm(b) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    "settings",
    [
        {"spread_px": -1.0},
        {"spread_px": 100.0},
        {"neighbourhood_weight": -0.5},
        {"dimension": 0},
        {"seed": -1},
        {"seed": 1 << 64},
    ],
)
def test_bad_settings_are_refused(settings: dict) -> None:
    with pytest.raises(UsageError):
        HashedEmbeddingConfig(**settings)
