"""Kinds that move are told from kinds that stand still."""

import numpy as np

from semrl.core.arrays import digest
from semrl.perception.embedding import Scenery

WALL, BALL, DIGIT, PADDLE = 0, 1, 2, 5


def frames(count, seed=0):
    """A wall of four, a ball that flies, a digit that changes now and then, a paddle that often rests."""
    rng = np.random.default_rng(seed)
    digit, paddle = 10.0, 40.0
    for i in range(count):
        digit = 10.0 + (i // 50) % 3
        paddle += rng.choice([0, 0, 0, 1, -1])
        ball = rng.uniform(0, 84, 2)
        centres = [[80, 4], [80, 12], [80, 20], [80, 28], ball, [4, digit], [paddle, 10]]
        yield np.array([WALL] * 4 + [BALL, DIGIT, PADDLE]), np.array(centres, dtype=np.float32)


def learned(count=300):
    scenery = Scenery()
    for classes, centres in frames(count):
        assert scenery.partial_fit(classes, centres) is scenery
    return scenery


def test_walls_and_digits_stand_still_and_balls_and_paddles_do_not():
    assert learned().still_.tolist() == [WALL, DIGIT]


def test_nothing_stands_still_before_it_was_seen_twice():
    assert Scenery().still_.tolist() == []
    assert learned(1).still_.tolist() == []


def test_an_object_of_another_class_at_the_same_place_has_moved_there():
    scenery = Scenery()
    for i in range(20):
        scenery.partial_fit(np.array([i % 2]), np.array([[5.0, 5.0]]))
    assert scenery.still_.tolist() == []


def test_frames_without_objects_do_no_harm():
    scenery = Scenery()
    for _ in range(3):
        scenery.partial_fit(np.empty(0, np.int64), np.empty((0, 2), np.float32))
    assert (scenery.frames_, scenery.still_.tolist()) == (3, [])


def test_it_goes_on_where_it_was_saved():
    whole, first = learned(40), learned(20)
    second = Scenery()
    second.from_arrays(first.to_arrays())
    for classes, centres in list(frames(40))[20:]:
        second.partial_fit(classes, centres)
    assert digest(second.to_arrays()) == digest(whole.to_arrays())
