import numpy as np
import pytest

from semrl.core.errors import DataError, UsageError
from semrl.perception.embedding import SlotsEmbedding, SlotsEmbeddingConfig, build_scene_graph


def test_objects_stand_by_class_and_place_whatever_their_order() -> None:
    classes, centres = np.array([2, 1, 1]), np.array([[42.0, 0], [84, 21], [21, 42]])
    for order in ([0, 1, 2], [2, 0, 1]):
        vector = SlotsEmbedding(SlotsEmbeddingConfig(dimension=16)).transform(
            build_scene_graph(classes[order], centres[order], 20.0)
        )
        expected = [1, 1 / 16, 0.25, 0.5, 1, 1 / 16, 1, 0.25, 1, 2 / 16, 0.5, 0, 0, 0, 0, 0]
        np.testing.assert_allclose(vector, expected)
        assert vector.dtype == np.float32


def test_what_has_no_slot_is_left_out() -> None:
    embed = SlotsEmbedding(SlotsEmbeddingConfig(dimension=8)).transform
    centres = np.arange(10_000, dtype=float).reshape(5000, 2) % 84
    few, many = (build_scene_graph(np.arange(n), centres[:n], 20.0) for n in (2, 5000))
    np.testing.assert_array_equal(embed(few), embed(many))
    np.testing.assert_array_equal(embed(build_scene_graph(np.zeros(0, int), np.zeros((0, 2)), 20.0)), np.zeros(8))


def test_bad_input_is_refused() -> None:
    for dimension in (0, 6):
        with pytest.raises(UsageError):
            SlotsEmbeddingConfig(dimension=dimension)
    broken = build_scene_graph(np.array([1]), np.array([[4.0, 4.0]]), 20.0)
    broken.centres_px[0, 0] = np.nan
    with pytest.raises(DataError):
        SlotsEmbedding().transform(broken)
