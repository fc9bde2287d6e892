"""The two hashes that the thesis prints, of objects on real frames of Pong, cut as the thesis cuts them."""

from collections.abc import Iterator

import numpy as np
import pytest

from semrl.core import Objects
from semrl.envs import Game, make_env
from semrl.perception.detection import OtsuDetector
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import build_scene_graph, wl_hashes

PROXIMITY_PX = 20.0
PRINTED_DIGIT = "dab5edacccee84e7f5d123489f3e151c"  # §3.2.3: 811111
PRINTED_WALL = "ec7a9c75e534f5a438c36cfb0c72ca7b"  # §4.1.3, "surrounded by exactly two walls": 2104
WALL, DIGIT, OTHER = 1, 8, 5


def frames(count: int) -> Iterator[np.ndarray]:
    game, rng = Game(make_env(), 3), np.random.default_rng(3)
    yield to_grey(game.reset().frame)
    for _ in range(count):
        yield to_grey(game.step(int(rng.integers(2))).observation.frame)


@pytest.fixture(scope="module")
def scenes() -> list[Objects]:
    images = list(frames(80))
    detector = OtsuDetector()
    for image in images:
        detector.partial_fit(image)
    return [detector.detect(image) for image in images[30:]]  # the first ones show a half-drawn screen


def is_wall(objects: Objects) -> np.ndarray:
    """The two bars across the whole screen: what was cut from a component as wide as the image."""
    tops = objects.boxes_px[:, 0]
    rows, counts = np.unique(tops, return_counts=True)
    return np.isin(tops, rows[counts >= 10])


def test_the_walls_are_cut_into_eleven_parts(scenes: list[Objects]) -> None:
    for objects in scenes:
        assert np.bincount(objects.boxes_px[is_wall(objects), 0]).max() == 11


def test_a_digit_of_the_score_has_the_first_printed_hash(scenes: list[Objects]) -> None:
    found = set()
    for objects in scenes:
        walls = is_wall(objects)
        above = objects.centres_px[:, 0] < objects.centres_px[walls, 0].min()  # the score stands above both walls
        for place in np.flatnonzero(above):
            classes = np.where(walls, WALL, OTHER)
            classes[place] = DIGIT
            found.add(wl_hashes(build_scene_graph(classes, objects.centres_px, PROXIMITY_PX), 1)[place][0])
    assert PRINTED_DIGIT in found


def test_a_wall_with_two_walls_beside_it_has_the_second_printed_hash(scenes: list[Objects]) -> None:
    found = set()
    for objects in scenes:
        for place in np.flatnonzero(is_wall(objects)):
            graph = build_scene_graph(np.full(len(objects), OTHER), objects.centres_px, PROXIMITY_PX)
            neighbours = graph.edges[(graph.edges == place).any(axis=1)].sum(axis=1) - place
            if len(neighbours) == 2 and is_wall(objects)[neighbours].all():
                classes = graph.classes.copy()
                classes[place], classes[neighbours[0]], classes[neighbours[1]] = 2, 10, 4
                found.add(wl_hashes(build_scene_graph(classes, objects.centres_px, PROXIMITY_PX), 1)[place][0])
    assert found == {PRINTED_WALL}
