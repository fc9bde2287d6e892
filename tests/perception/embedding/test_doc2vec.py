import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from semrl.core import SceneGraph
from semrl.core.arrays import digest
from semrl.core.errors import DataError, MissingExtraError, UsageError
from semrl.core.protocols import Persistent
from semrl.perception.embedding import Doc2VecConfig, Doc2VecEmbedding, WordsConfig, build_scene_graph, document
from semrl.perception.embedding import doc2vec as doc2vec_module

VARIANTS = {
    "dbow": {},
    "dm": {"words": WordsConfig(form="pv-dm")},
    "dbow-negative": {"negative": 5, "hierarchical_softmax": False, "down_sampling": 0.0},
    "dm-both": {"words": WordsConfig(form="pv-dm"), "negative": 3},
}

# Runs in other processes: learn from the scenes of this very file, or go on from a file of arrays.
CHILD = """
import sys
from pathlib import Path
import numpy as np
sys.path.insert(0, sys.argv[1])
from test_doc2vec import VARIANTS, config, pong
from semrl.core.arrays import digest
from semrl.perception.embedding import Doc2VecEmbedding
for name in VARIANTS:
    embedding = Doc2VecEmbedding(config(name))
    if sys.argv[2] == "fit":
        embedding.fit(pong(60))
    else:
        embedding.from_arrays(dict(np.load(Path(sys.argv[2]) / f"{name}.npz")))
    print(digest(embedding.to_arrays()), embedding.transform(pong(3, seed=1)[2]).tobytes().hex())
"""


def config(name: str) -> Doc2VecConfig:
    return Doc2VecConfig(documents=60, dimension=16, epochs=4, **VARIANTS[name])


def pong(count: int, seed: int = 0) -> list[SceneGraph]:
    """Scenes like Pong's: two rows of wall, two digits, two paddles and a ball that wander."""
    rng = np.random.default_rng(seed)
    still = [(row, column) for row in (14, 78) for column in range(4, 84, 16)] + [(4, 21), (4, 61)]
    classes = np.array([1] * 10 + [8, 8] + [2, 2, 3])
    places = np.array([[30, 8], [50, 76], [40, 40]], dtype=float)
    scenes = []
    for _ in range(count):
        places[:, 0] = np.clip(places[:, 0] + rng.integers(-5, 6, 3), 20, 72)
        places[2, 1] = np.clip(places[2, 1] + rng.integers(-5, 6), 12, 72)
        scenes.append(build_scene_graph(classes, np.vstack([still, places]), 20.0))
    return scenes


def run_child(source: str, hash_seed: str) -> list[str]:
    return subprocess.run(
        [sys.executable, "-c", CHILD, str(Path(__file__).parent), source],
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()


@pytest.fixture(scope="module")
def learned() -> dict[str, Doc2VecEmbedding]:
    pytest.importorskip("gensim")
    return {name: Doc2VecEmbedding(config(name)).fit(pong(60)) for name in VARIANTS}


def fingerprints(embeddings: dict[str, Doc2VecEmbedding]) -> list[str]:
    scene = pong(3, seed=1)[2]
    return [f"{digest(e.to_arrays())} {e.transform(scene).tobytes().hex()}" for e in embeddings.values()]


def test_defaults_are_the_thesis_parameters() -> None:
    settings = Doc2VecConfig()
    assert (settings.documents, settings.dimension, settings.min_count, settings.epochs) == (
        30_000,
        128,
        2,
        20,
    )
    assert (settings.learning_rate, settings.window_words, settings.hierarchical_softmax) == (0.025, 16, True)
    assert (settings.negative, settings.max_vocabulary_words, settings.words.form) == (0, 30_000, "pv-dbow")


def test_it_offers_what_an_embedder_must(learned: dict[str, Doc2VecEmbedding]) -> None:
    for embedding in learned.values():
        assert isinstance(embedding, Persistent)
        assert (embedding.documents_needed, embedding.dimension) == (60, 16)
        vector = embedding.transform(pong(1)[0])
        assert (vector.shape, vector.dtype) == ((16,), np.float32)
        assert embedding.document_vectors_.shape == (60, 16)


def test_the_vocabulary_is_the_words_that_occur_often_enough(learned: dict[str, Doc2VecEmbedding]) -> None:
    for embedding in learned.values():
        texts = [word for scene in pong(60) for word in document(scene, embedding.config.words)]
        _, counts = np.unique(texts, return_counts=True)
        assert embedding.vocabulary_size_ == np.sum(counts >= 2)


def test_transform_is_a_function_of_its_input_and_learns_nothing(
    learned: dict[str, Doc2VecEmbedding],
) -> None:
    scenes = pong(5, seed=2)
    for embedding in learned.values():
        before = digest(embedding.to_arrays())
        once = [embedding.transform(scene) for scene in scenes]
        again = [embedding.transform(scene) for scene in reversed(scenes)]
        np.testing.assert_array_equal(once, again[::-1])
        assert digest(embedding.to_arrays()) == before


def test_inference_does_what_gensim_does(learned: dict[str, Doc2VecEmbedding]) -> None:
    # Gensim starts elsewhere and draws other random numbers, so ours is only as close as two of its own.
    for name in ("dbow", "dbow-negative"):
        embedding = learned[name]
        scene = pong(30)[29]
        ours = embedding.transform(scene)
        theirs = embedding.model_.infer_vector(document(scene, embedding.config.words))
        assert ours @ theirs / np.linalg.norm(ours) / np.linalg.norm(theirs) > 0.9


def test_compiled_inference_takes_the_steps_of_gensim(
    learned: dict[str, Doc2VecEmbedding], monkeypatch: pytest.MonkeyPatch
) -> None:
    embedding = learned["dbow"]
    scenes = pong(30, seed=3)
    compiled = [embedding.transform(scene) for scene in scenes]
    assert embedding._tree is not None
    assert all(learned[name]._tree is None for name in VARIANTS if name != "dbow")
    monkeypatch.setattr(embedding, "_tree", None)
    by_gensim = [embedding.transform(scene) for scene in scenes]
    # Sums in another order; where one falls into the next cell of the sigmoid's table, a step differs by 0.1 % of it.
    np.testing.assert_allclose(compiled, by_gensim, atol=1e-4)
    assert np.abs(by_gensim).max() > 0.01


def test_learning_again_elsewhere_gives_the_same_bits(learned: dict[str, Doc2VecEmbedding]) -> None:
    assert run_child("fit", hash_seed="1") == fingerprints(learned)


def test_arrays_carry_everything_to_another_process(learned: dict[str, Doc2VecEmbedding], tmp_path: Path) -> None:
    for name, embedding in learned.items():
        np.savez(tmp_path / f"{name}.npz", **embedding.to_arrays())
        assert not any(array.dtype == object for array in embedding.to_arrays().values())
    assert run_child(str(tmp_path), hash_seed="2") == fingerprints(learned)


def test_arrays_share_no_memory(learned: dict[str, Doc2VecEmbedding]) -> None:
    for name, embedding in learned.items():
        arrays = embedding.to_arrays()
        other = Doc2VecEmbedding(config(name))
        other.from_arrays(arrays)
        for array in arrays.values():
            if array.flags.writeable:
                array[...] = 0
        assert digest(other.to_arrays()) == digest(embedding.to_arrays())


def test_pv_dbow_recognises_the_scenes_it_learned() -> None:
    pytest.importorskip("gensim")
    scenes = pong(150)
    embedding = Doc2VecEmbedding(Doc2VecConfig(dimension=32, epochs=10)).fit(scenes)
    learned = embedding.document_vectors_ / np.linalg.norm(embedding.document_vectors_, axis=1, keepdims=True)
    inferred = np.array([embedding.transform(scene) for scene in scenes])
    nearest = np.argmax(inferred @ learned.T, axis=1)
    assert np.mean(nearest == np.arange(150)) > 0.5  # by chance 0.007


def test_edge_cases(learned: dict[str, Doc2VecEmbedding]) -> None:
    nothing = build_scene_graph(np.zeros(0, dtype=int), np.zeros((0, 2)), 20.0)
    unknown = build_scene_graph(np.array([77]), np.array([[500.0, 500.0]]), 20.0)
    for embedding in learned.values():
        np.testing.assert_array_equal(embedding.transform(nothing), np.zeros(16))
        np.testing.assert_array_equal(embedding.transform(unknown), embedding.transform(unknown))
    fresh = Doc2VecEmbedding(config("dbow"))
    assert fresh.to_arrays() == {}
    fresh.from_arrays({})
    with pytest.raises(UsageError, match="fit"):
        fresh.transform(nothing)
    one_word = build_scene_graph(np.array([1]), np.array([[0.0, 0.0]]), 20.0)
    for scenes in ([], [nothing] * 3, [one_word]):
        with pytest.raises(DataError, match="two words"):
            fresh.fit(scenes)


def test_arrays_of_other_settings_are_refused(learned: dict[str, Doc2VecEmbedding]) -> None:
    with pytest.raises(DataError, match="settings"):
        Doc2VecEmbedding(Doc2VecConfig()).from_arrays(learned["dbow"].to_arrays())


def test_a_missing_gensim_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(doc2vec_module, "find_spec", lambda name: None if name == "gensim" else real(name))
    with pytest.raises(MissingExtraError, match=r"pip install .*'gensim"):
        Doc2VecEmbedding()


@pytest.mark.parametrize(
    "settings",
    [
        {"documents": 0},
        {"epochs": 0},
        {"learning_rate": 0.0},
        {"negative": -1},
        {"hierarchical_softmax": False},
        {"seed": -1},
    ],
)
def test_bad_settings_are_refused(settings: dict) -> None:
    with pytest.raises(UsageError):
        Doc2VecConfig(**settings)
