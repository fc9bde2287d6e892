"""Embeddings are judged on what is known to be true of them."""

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.perception.embedding import FractionalEmbedding, SlotsEmbedding, build_scene_graph
from semrl.perception.perception import Perception
from semrl.training import preset
from semrl_thesis.comparison import CANDIDATES, MEASURED, candidate_config
from semrl_thesis.comparison import EXPERIMENT as COMPARISON
from semrl_thesis.drift import EXPERIMENT as DRIFT
from semrl_thesis.drift import METHODS, cosines_to, turned_back
from semrl_thesis.embedding_evaluation import call_judge
from semrl_thesis.perception import make_embedder
from semrl_thesis.watching import COORDINATES, Watched, watch


def pong_like(count: int, seed: int) -> Watched:
    """Two paddles of one kind and a ball, where the RAM says they are; each coordinate moves by steps."""
    rng = np.random.default_rng(seed)
    rows = np.cumsum(rng.integers(-2, 3, (count, 4)), axis=0) % 60 + 12.0  # player, enemy, ball's column, ball's row
    scenes = [
        build_scene_graph(np.array([0, 0, 7]), np.array([[player, 74], [enemy, 9], [row, column]]), 20.0)
        for player, enemy, column, row in rows
    ]
    bytes_ = rows / (0.4, 0.4, 84 / 160, 0.4) + (13, 13, 49, 13)
    return Watched(scenes=scenes, coordinates=bytes_, starts=np.arange(count) % 200 == 0)


@pytest.fixture(scope="module")
def evaluator():
    return call_judge(pong_like(1500, 0), pong_like(400, 1))


def test_places_as_phases_are_found_kept_and_read_off(evaluator):
    found = evaluator.evaluator(FractionalEmbedding())
    assert found["ratio"] > 0.9
    assert found["pearson"] < -0.9
    assert all(found[f"r2-{name.replace('_', '-')}"] > 0.98 for name in COORDINATES)


def test_what_knows_nothing_is_found_out(evaluator):
    class Blind(SlotsEmbedding):
        def transform(self, graph):
            return np.ones_like(super().transform(graph))

    found = evaluator.evaluator(Blind())
    assert found["ratio"] < 0.5
    assert np.isnan(found["pearson"])
    assert all(abs(found[f"r2-{name.replace('_', '-')}"]) < 0.5 for name in COORDINATES)


def test_the_ball_is_visible_where_an_object_is_found_at_its_place():
    watched = pong_like(5, 0)
    assert watched.ball_visible.all()
    moved = watched.coordinates.copy()
    moved[2, 2] += 40
    other = Watched(scenes=watched.scenes, coordinates=moved, starts=watched.starts)
    assert other.ball_visible.tolist() == [True, True, False, True, True]
    assert watched.adjacent.tolist() == [0, 1, 2, 3]
    assert len(watched.first(2)) == 2


def test_pong_is_watched_and_no_other_game():
    config = preset("semrl", "semantic", {"env": "BreakoutNoFrameskip-v4"})
    with pytest.raises(UsageError, match="Pong"):
        watch(Perception(config.perception), config, 1, 0)


def test_turning_back_undoes_a_rotation():
    rng = np.random.default_rng(0)
    before = rng.normal(size=(200, 16)).astype(np.float32)
    rotation, _ = np.linalg.qr(rng.normal(size=(16, 16)))
    after = (before @ rotation).astype(np.float32)
    assert cosines_to(before, after).mean() < 0.5
    np.testing.assert_allclose(turned_back(before, after), before[1::2], atol=1e-5)


def test_scenes_without_objects_do_not_count_as_drift():
    before = np.array([[1.0, 0], [0, 0]], np.float32)
    assert cosines_to(before, before).tolist() == [1.0]


@pytest.mark.parametrize("settings", [*CANDIDATES.values()], ids=[*CANDIDATES])
def test_candidates_are_settings_of_perception(settings):
    assert candidate_config({}, settings).perception.embedder == settings["embedder"]


def test_every_number_is_announced():
    announced = {number.id for number in COMPARISON.numbers}
    assert {f"comparison/{name}/{what}" for name in CANDIDATES for what in MEASURED} < announced
    assert {f"drift/{name}/cosine" for name in METHODS} < {number.id for number in DRIFT.numbers}
    assert all(make_embedder(candidate_config({}, {"embedder": "online", "online": m.online}))
               for m in METHODS.values())  # fmt: skip
