import numpy as np
import pytest

from semrl.core.errors import DataError, UsageError
from semrl.perception.embedding import SceneGraphConfig, build_scene_graph


def brute_force(centres: np.ndarray, proximity_px: float) -> tuple[list[list[int]], list[float]]:
    edges, lengths = [], []
    for i in range(len(centres)):
        for j in range(i + 1, len(centres)):
            length = float(np.hypot(*(centres[i].astype(float) - centres[j].astype(float))))
            if length <= proximity_px:
                edges.append([i, j])
                lengths.append(length)
    return edges, lengths


# On a half-pixel grid many distances equal the limit (12² + 16² = 20²); above 256 objects a tree is used.
@pytest.mark.parametrize("count", [1, 2, 30, 80, 256, 257, 400])
def test_edges_are_those_of_brute_force(count: int) -> None:
    rng = np.random.default_rng(count)
    centres = (rng.integers(0, 168, (count, 2)) / 2).astype(np.float32)
    classes = rng.integers(0, 10, count)
    graph = build_scene_graph(classes, centres, 20.0)
    edges, lengths = brute_force(centres, 20.0)
    np.testing.assert_array_equal(graph.edges, np.array(edges, dtype=np.int64).reshape(-1, 2))
    np.testing.assert_allclose(graph.lengths_px, lengths, rtol=1e-6)
    np.testing.assert_array_equal(graph.classes, classes)
    np.testing.assert_array_equal(graph.centres_px, centres)
    assert (graph.edges.dtype, graph.lengths_px.dtype) == (np.int64, np.float32)


@pytest.mark.parametrize("padding", [0, 300])
def test_the_limit_itself_is_close_enough(padding: int) -> None:
    far = np.stack([np.arange(padding) * 100.0 + 1000, np.zeros(padding)], axis=1)
    centres = np.vstack([[[0, 0], [12, 16], [0, 20.5]], far])
    graph = build_scene_graph(np.zeros(len(centres), dtype=int), centres, 20.0)
    assert graph.edges.tolist() == [[0, 1], [1, 2]]
    assert graph.lengths_px[0] == 20.0


def test_objects_in_one_place_are_joined_even_without_proximity() -> None:
    graph = build_scene_graph(np.array([1, 2, 3]), np.array([[5, 5], [5, 5], [5, 6]]), 0.0)
    assert graph.edges.tolist() == [[0, 1]]
    assert graph.lengths_px.tolist() == [0.0]


def test_no_objects_make_an_empty_graph() -> None:
    graph = build_scene_graph(np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32), 20.0)
    assert len(graph) == 0
    assert (graph.edges.shape, graph.lengths_px.shape, graph.centres_px.shape) == ((0, 2), (0,), (0, 2))


def test_five_thousand_objects_are_no_trouble() -> None:
    rng = np.random.default_rng(0)
    centres = rng.uniform(0, 2000, (5000, 2)).astype(np.float32)
    graph = build_scene_graph(np.zeros(5000, dtype=int), centres, 20.0)
    pairs = graph.edges.tolist()
    assert len(pairs) > 1000
    assert pairs == sorted(pairs)
    gaps = centres[graph.edges[:, 0]].astype(float) - centres[graph.edges[:, 1]].astype(float)
    np.testing.assert_allclose(graph.lengths_px, np.hypot(gaps[:, 0], gaps[:, 1]), rtol=1e-6)


def test_the_graph_shares_no_memory_with_the_arguments() -> None:
    classes, centres = np.array([1, 2]), np.array([[1, 2], [3, 4]], dtype=np.float32)
    graph = build_scene_graph(classes, centres, 20.0)
    classes[:] = 9
    centres[:] = 9
    assert graph.classes.tolist() == [1, 2]
    assert graph.centres_px.tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(
    ("classes", "centres", "proximity_px"),
    [
        (np.array([1, 2]), np.zeros((3, 2)), 20.0),
        (np.array([1, 2]), np.zeros((2, 3)), 20.0),
        (np.array([], dtype=int), np.zeros((1, 2)), 20.0),
        (np.array([0.5]), np.zeros((1, 2)), 20.0),
        (np.array([1]), np.array([[np.nan, 0]]), 20.0),
        (np.array([1]), np.array([[0, np.inf]]), 20.0),
        (np.array([1]), np.zeros((1, 2)), -1.0),
        (np.array([1]), np.zeros((1, 2)), np.nan),
    ],
)
def test_bad_input_is_named_in_one_line(classes: np.ndarray, centres: np.ndarray, proximity_px: float) -> None:
    with pytest.raises(DataError) as error:
        build_scene_graph(classes, centres, proximity_px)
    assert "\n" not in str(error.value)


def test_bad_settings_are_refused() -> None:
    assert SceneGraphConfig().proximity_px == 20.0
    with pytest.raises(UsageError):
        SceneGraphConfig(proximity_px=-1)
