import numpy as np
import pytest

from semrl.core import SceneGraph
from semrl.core.errors import DataError, UsageError
from semrl.perception.embedding import FractionalEmbedding, FractionalEmbeddingConfig, build_scene_graph


def scene(*objects: tuple[int, float, float]) -> SceneGraph:
    classes = np.array([number for number, _, _ in objects], dtype=int)
    centres = np.array([place for _, *place in objects], dtype=float).reshape(-1, 2)
    return build_scene_graph(classes, centres, 20.0)


def random_scene(seed: int, count: int = 25) -> SceneGraph:
    rng = np.random.default_rng(seed)
    return build_scene_graph(rng.integers(0, 5, count), rng.uniform(0, 84, (count, 2)), 20.0)


def test_similarity_is_the_normal_curve_of_the_distance() -> None:
    embed = FractionalEmbedding(FractionalEmbeddingConfig(dimension=2048, width_px=10.0)).transform
    here = embed(scene((3, 40, 40)))
    for row, column in ((40, 40), (43, 44), (50, 40), (30, 47.5), (60, 60), (84, 0)):
        squared = (row - 40) ** 2 + (column - 40) ** 2
        assert here @ embed(scene((3, row, column))) == pytest.approx(np.exp(-squared / 200), abs=0.02)


def test_classes_know_nothing_of_each_other() -> None:
    embed = FractionalEmbedding(FractionalEmbeddingConfig(dimension=2048)).transform
    vectors = np.stack([embed(scene((number, 40, 40))) for number in (-3, 0, 1, 2, 9_999_999)])
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(5), atol=0.1)


def test_a_scene_is_the_sum_of_its_objects_in_any_order_to_the_last_bit() -> None:
    first = random_scene(1)
    order = np.random.default_rng(0).permutation(len(first))
    shuffled = build_scene_graph(first.classes[order], first.centres_px[order], 20.0)
    embed = FractionalEmbedding().transform
    np.testing.assert_array_equal(embed(first), embed(shuffled))
    alone = [embed(scene((int(c), *p))) for c, p in zip(first.classes, first.centres_px.tolist(), strict=True)]
    np.testing.assert_allclose(embed(first), np.sum(alone, axis=0), atol=1e-5)


def test_no_bit_depends_on_what_is_embedded_together() -> None:
    crowd, one_by_one = random_scene(2, 500), FractionalEmbedding()
    objects = FractionalEmbedding().objects(crowd)
    for row, number, place in zip(objects, crowd.classes, crowd.centres_px.tolist(), strict=True):
        np.testing.assert_array_equal(one_by_one.transform(scene((int(number), *place))), row)


def test_places_can_be_read_off_by_a_linear_function() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(4, 80, (900, 3, 2))
    vectors = np.stack([FractionalEmbedding().transform(scene(*((i, *p) for i, p in enumerate(o)))) for o in places])
    inputs, truth = np.column_stack([vectors, np.ones(900)]), places.reshape(900, 6)
    weights = np.linalg.lstsq(inputs[:600], truth[:600], rcond=None)[0]
    errors = truth[600:] - inputs[600:] @ weights
    assert (errors.var(axis=0) < 0.02 * truth[600:].var(axis=0)).all()


def test_seeds_are_different_functions_of_the_same_quality() -> None:
    one, two = (FractionalEmbedding(FractionalEmbeddingConfig(seed=seed)).transform for seed in (0, 1))
    a, b = scene((0, 10, 10)), scene((0, 14, 10))
    assert abs(one(a) @ two(a)) < 0.5
    assert one(a) @ one(b) == pytest.approx(two(a) @ two(b), abs=1e-5)


def test_what_there_is_to_see_at_the_limits() -> None:
    embed = FractionalEmbedding().transform
    np.testing.assert_array_equal(embed(scene()), np.zeros(128, np.float32))
    crowd = embed(random_scene(0, 5000))
    assert crowd.dtype == np.float32 and np.isfinite(crowd).all()
    np.testing.assert_allclose(embed(scene(*[(1, 5, 5)] * 5000)), 5000 * embed(scene((1, 5, 5))), rtol=1e-5, atol=1e-3)
    broken = scene((1, 5, 5))
    for bad in (np.nan, np.inf, 1e30):
        broken.centres_px[0, 1] = bad
        with pytest.raises(DataError):
            embed(broken)


@pytest.mark.parametrize(
    "settings",
    [{"dimension": 127}, {"dimension": 0}, {"width_px": 0.0}, {"width_px": np.nan}, {"seed": -1}, {"seed": 1 << 64}],
)
def test_bad_settings_are_refused(settings: dict) -> None:
    with pytest.raises(UsageError):
        FractionalEmbeddingConfig(**settings)
