import os
import subprocess
import sys

import numpy as np
import pytest

from semrl.core import SceneGraph
from semrl.core.errors import DataError, UsageError
from semrl.perception.embedding import (
    FractionalEmbedding,
    OnlineEmbedding,
    OnlineEmbeddingConfig,
    build_scene_graph,
    online_kernels,
)
from semrl.perception.embedding.online_kernels import NOISE_POWER


def random_scene(seed: int, count: int = 12, low: float = 0.0, high: float = 84.0) -> SceneGraph:
    rng = np.random.default_rng(seed)
    return build_scene_graph(rng.integers(0, 4, count), rng.uniform(low, high, (count, 2)), 20.0)


def topic_scene(*classes: int) -> SceneGraph:
    """Objects of which each class has its own place, so that scenes without a common class have no common word."""
    return build_scene_graph(np.array(classes), 100.0 * np.array(classes)[:, None] + (0, 50), 20.0)


def cosine(a: np.ndarray, b: np.ndarray) -> float:
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def learned(config: OnlineEmbeddingConfig | None = None, documents: int = 60) -> OnlineEmbedding:
    return OnlineEmbedding(config).fit([random_scene(seed) for seed in range(documents)])


def test_scenes_of_one_topic_get_nearer_than_others() -> None:
    # Two topics of eight classes. The scenes that are compared have no word in common, whatever their topic.
    rng = np.random.default_rng(0)
    config = OnlineEmbeddingConfig(halving_documents=0, anchor=0, down_sampling=1, buckets=4096)
    embedding = OnlineEmbedding(config).partial_fit(topic_scene(0))

    def nearness() -> tuple[float, float]:
        first, same, other = (embedding.transform(topic_scene(*c)) for c in ((0, 1, 2), (3, 4, 5), (8, 9, 10)))
        return cosine(first, same), cosine(first, other)

    before = nearness()
    for i in range(2000):
        embedding.partial_fit(topic_scene(*(8 * (i % 2) + rng.choice(8, 3, replace=False))))
    after = nearness()
    assert max(np.abs(before)) < 0.3
    assert after[0] > after[1] + 0.5


def test_frequencies_are_kept_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(online_kernels, "NOISE_WORDS", 1 << 13)
    embedding = OnlineEmbedding(OnlineEmbeddingConfig(buckets=64))
    sizes = set()
    for seed in range(400):
        embedding.partial_fit(random_scene(seed))
        sizes.add(sum(array.nbytes for array in embedding.to_arrays().values()))
    memory = embedding.memory_
    assert memory is not None and max(sizes) - min(sizes) < 8  # only a number in the settings may be longer
    assert memory.counts.sum() == memory.totals[0] == 400 * 12 * 15
    assert memory.totals[1] == pytest.approx((memory.counts**NOISE_POWER).sum())
    assert memory.totals[2] == len(memory.noise) == 1 << 13  # full, so that it was written over
    drawn = np.bincount(memory.noise, minlength=64) / len(memory.noise)
    expected = memory.counts**NOISE_POWER / memory.totals[1]
    assert np.abs(drawn - expected).max() < 0.006


def test_the_anchor_holds_words_and_without_learning_it_is_the_prior() -> None:
    scene, shifts = random_scene(1000), []
    for anchor in (0.0, 1.0, 10.0, 100.0):
        embedding = learned(OnlineEmbeddingConfig(anchor=anchor))
        shifts.append(np.linalg.norm(embedding.transform(scene) - FractionalEmbedding().transform(scene)))
    assert shifts == sorted(shifts, reverse=True)
    assert shifts[-1] < 0.2 * shifts[0]


def test_words_never_met_add_nothing() -> None:
    embedding = OnlineEmbedding().partial_fit(random_scene(0))
    far = build_scene_graph(np.array([99]), np.array([[300.0, 300.0]]), 20.0)
    np.testing.assert_array_equal(embedding.transform(far), FractionalEmbedding().transform(far))


def test_fit_is_one_pass_and_forgets_what_was_before() -> None:
    scenes = [random_scene(seed) for seed in range(20)]
    embedding = learned()
    embedding.fit(scenes)
    other = OnlineEmbedding()
    for scene in scenes:
        other.partial_fit(scene)
    assert embedding.documents_ == 20
    np.testing.assert_array_equal(embedding.transform(scenes[3]), other.transform(scenes[3]))
    assert 0 < embedding.vocabulary_size_ <= len(scenes) * 12 * 15


def test_the_order_of_objects_does_not_matter_to_the_last_bit() -> None:
    embedding, scene = learned(), random_scene(4)
    order = np.random.default_rng(0).permutation(len(scene))
    other = build_scene_graph(scene.classes[order], scene.centres_px[order], 20.0)
    np.testing.assert_array_equal(embedding.transform(scene), embedding.transform(other))


def test_the_same_bits_in_every_process() -> None:
    code = (
        "import numpy as np; from semrl.perception.embedding import *\n"
        "rng = np.random.default_rng(3)\n"
        "scenes = [build_scene_graph(rng.integers(0, 5, 9), rng.uniform(0, 84, (9, 2)), 20.0) for _ in range(40)]\n"
        "embedding = OnlineEmbedding().fit(scenes)\n"
        "print(np.stack([embedding.transform(scene) for scene in scenes]).tobytes().hex()[-4000:])"
    )
    told = [
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed, threads in (("1", "1"), ("2", "2"))
    ]
    assert told[0] == told[1] and len(told[0]) > 4000


def test_what_there_is_to_see_at_the_limits() -> None:
    empty = build_scene_graph(np.zeros(0, dtype=int), np.zeros((0, 2)), 20.0)
    embedding = OnlineEmbedding().partial_fit(empty)
    np.testing.assert_array_equal(embedding.transform(empty), np.zeros(128, np.float32))
    crowd = random_scene(0, 5000)
    vector = embedding.partial_fit(crowd).transform(crowd)
    assert vector.dtype == np.float32 and np.isfinite(vector).all()
    assert np.isfinite(embedding.transform(random_scene(1))).all()


def test_what_is_not_finite_is_refused_and_not_learned() -> None:
    embedding, broken = learned(documents=5), random_scene(0)
    before = embedding.transform(random_scene(1))
    for bad in (np.nan, np.inf, 1e30):
        broken.centres_px[2, 1] = bad
        for call in (embedding.partial_fit, embedding.transform):
            with pytest.raises(DataError):
                call(broken)
    assert embedding.documents_ == 5
    np.testing.assert_array_equal(embedding.transform(random_scene(1)), before)


def test_arrays_of_other_settings_are_refused() -> None:
    with pytest.raises(DataError, match="other settings"):
        OnlineEmbedding(OnlineEmbeddingConfig(seed=1)).from_arrays(learned(documents=2).to_arrays())


@pytest.mark.parametrize(
    "settings",
    [
        {"documents": 0},
        {"buckets": 0},
        {"negative": 0},
        {"prior": -1.0},
        {"corruption": 1.0},
        {"learning_rate": 0.0},
        {"learning_rate": np.nan},
        {"halving_documents": -1},
        {"anchor": -1.0},
        {"down_sampling": 0.0},
        {"seed": -1},
        {"dimension": 127},
        {"width_px": 0.0},
    ],
)
def test_bad_settings_are_refused(settings: dict) -> None:
    with pytest.raises(UsageError):
        OnlineEmbeddingConfig(**settings)
