import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semrl.core import SceneGraph
from semrl.core.errors import DataError, UsageError
from semrl.perception.embedding import build_scene_graph
from semrl_thesis.graph_distance import GraphDistanceConfig, graph_distance, graph_distances, nearest_graphs


def scene(*objects: tuple[int, float, float]) -> SceneGraph:
    classes = np.array([number for number, _, _ in objects], dtype=int)
    centres = np.array([place for _, *place in objects], dtype=float).reshape(-1, 2)
    return build_scene_graph(classes, centres, 20.0)


def by_hand(first: SceneGraph, second: SceneGraph, config: GraphDistanceConfig) -> float:
    """The formula of §4.1.3, word by word."""
    few, many = (first, second) if len(first) <= len(second) else (second, first)
    total = (len(many) - len(few)) * config.number_penalty
    for a, (row, column) in zip(few.classes, few.centres_px.astype(float), strict=True):
        total += min(
            np.hypot(row - r, column - c) + (a != b) * config.class_penalty
            for b, (r, c) in zip(many.classes, many.centres_px.astype(float), strict=True)
        )
    return float(total)


objects = st.tuples(st.integers(0, 3), *[st.integers(0, 168).map(lambda half: half / 2)] * 2)
scenes = st.lists(objects, min_size=1, max_size=8).map(lambda listed: scene(*listed))


@settings(deadline=None)  # the first call compiles
@given(scenes, scenes, st.sampled_from([0.0, 3.0, 100.0]))
def test_it_is_the_formula(first: SceneGraph, second: SceneGraph, penalty: float) -> None:
    config = GraphDistanceConfig(class_penalty=penalty, number_penalty=2 * penalty)
    assert graph_distance(first, second, config) == pytest.approx(by_hand(first, second, config))


@settings(deadline=None)
@given(scenes)
def test_a_scene_is_no_way_from_itself(one: SceneGraph) -> None:
    assert graph_distance(one, one) == 0


@settings(deadline=None)
@given(scenes, scenes)
def test_scenes_of_different_sizes_are_as_far_apart_both_ways(first: SceneGraph, second: SceneGraph) -> None:
    if len(first) != len(second):
        assert graph_distance(first, second) == pytest.approx(graph_distance(second, first))


def test_what_the_thesis_allows_for() -> None:
    ball, far_ball, paddle = (0, 10.0, 10.0), (0, 13.0, 14.0), (1, 10.0, 10.0)
    assert graph_distance(scene(ball), scene(far_ball)) == 5  # 3² + 4² = 5²
    assert graph_distance(scene(ball), scene(paddle)) == 100  # mislabelled
    assert graph_distance(scene(ball, paddle), scene(ball)) == 100  # one is missing
    assert graph_distance(scene(), scene(ball, paddle)) == 200
    assert graph_distance(scene(), scene()) == 0


def test_of_two_scenes_with_equally_many_objects_the_first_one_asks() -> None:
    first, second = scene((0, 0, 0), (0, 0, 1)), scene((0, 0, 0), (0, 0, 9))
    assert (graph_distance(first, second), graph_distance(second, first)) == (1, 8)


def test_the_nearest_is_the_one_of_all_pairs() -> None:
    rng = np.random.default_rng(0)
    many = [
        scene(*((rng.integers(3), *rng.integers(0, 168, 2) / 2) for _ in range(rng.integers(0, 9)))) for _ in range(80)
    ]
    queries, graphs = many[:30], many[20:]
    table = np.array([[graph_distance(query, graph) for graph in graphs] for query in queries])
    places, distances = nearest_graphs(queries, graphs)
    np.testing.assert_array_equal(places, table.argmin(axis=1))
    np.testing.assert_allclose(distances, table.min(axis=1))


def test_bad_input_is_told() -> None:
    with pytest.raises(DataError, match="pairs of scenes, not 1 and 2"):
        graph_distances([scene()], [scene(), scene()])
    with pytest.raises(DataError, match="no scenes to search"):
        nearest_graphs([scene()], [])
    with pytest.raises(UsageError, match="finite numbers"):
        GraphDistanceConfig(class_penalty=-1)
