import numpy as np
import pytest

from semrl.core import SceneGraph
from semrl.core.errors import DataError
from semrl.perception.embedding import HashedEmbedding, HashedEmbeddingConfig, build_scene_graph
from semrl_thesis import similarity as retrieval


def ball(row: float, column: float) -> SceneGraph:
    return build_scene_graph(np.array([0, 1]), np.array([[40.0, 5.0], [row, column]]), 20.0)


SCENES = [ball(row, 50) for row in range(0, 80, 4)]
EMBEDDER = HashedEmbedding(HashedEmbeddingConfig(dimension=512, spread_px=8.0))
VECTORS = retrieval.embed(EMBEDDER, SCENES)


def test_a_good_embedding_finds_its_own_scenes_and_near_ones() -> None:
    itself = retrieval.retrieve(VECTORS, SCENES, VECTORS, SCENES)
    assert itself.places.tolist() == list(range(len(SCENES))) and itself.within(1e-9) == 1
    moved = [ball(row + 1, 50) for row in range(0, 80, 4)]
    near = retrieval.retrieve(retrieval.embed(EMBEDDER, moved), moved, VECTORS, SCENES)
    assert near.within(5) >= 0.9
    assert near.within(1) == 0
    assert retrieval.search(moved, SCENES).distances == pytest.approx(1)


def test_an_embedding_by_chance_does_not() -> None:
    rng = np.random.default_rng(0)
    lost = retrieval.retrieve(rng.normal(size=VECTORS.shape).astype(np.float32), SCENES, VECTORS, SCENES)
    assert np.mean(lost.places == np.arange(len(SCENES))) < 0.5


def test_no_embedding_beats_the_search() -> None:
    queries = [ball(row, 53) for row in (1.5, 20.5, 77)]
    found = retrieval.retrieve(retrieval.embed(EMBEDDER, queries), queries, VECTORS, SCENES)
    assert (retrieval.search(queries, SCENES).distances <= found.distances).all()


def test_vectors_that_were_learned_with_the_model_are_taken_as_they_are() -> None:
    class Learned(HashedEmbedding):
        document_vectors_ = VECTORS + 1

    assert retrieval.learned_vectors(Learned(EMBEDDER.config), SCENES) is Learned.document_vectors_
    np.testing.assert_array_equal(retrieval.learned_vectors(EMBEDDER, SCENES), VECTORS)


def test_cosines_and_zeros() -> None:
    first = np.array([[1, 0], [1, 1], [0, 0]], np.float32)
    second = np.array([[3, 0], [-2, 2], [1, 0]], np.float32)
    np.testing.assert_allclose(retrieval.cosine_similarities(first, second), [1, 0, 0], atol=1e-7)


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = retrieval.most_similar(VECTORS, VECTORS[::-1])
    monkeypatch.setattr(retrieval, "_BLOCK", 45)
    np.testing.assert_array_equal(retrieval.most_similar(VECTORS, VECTORS[::-1]), whole)


def test_nothing_to_search_is_told() -> None:
    with pytest.raises(DataError, match="no vectors to search"):
        retrieval.most_similar(VECTORS, VECTORS[:0])
