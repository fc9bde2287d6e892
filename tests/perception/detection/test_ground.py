"""The ground is the background in rectangles: there until the open colour shows in its place."""

import numpy as np
import pytest

from semrl.core.things import COLUMNS, GROUND, ID, KIND, LEFT, STILL
from semrl.perception.detection import Ground

OPEN, WALL, BRICK, BALL = (0, 0, 0), (140, 140, 140), (200, 70, 70), (250, 250, 250)


def picture():
    image = np.zeros((210, 160, 3), np.uint8)
    image[10:20], image[20:, :8] = WALL, WALL
    image[60:66, 8:152] = BRICK
    return image


@pytest.fixture
def ground():
    return Ground(picture(), 12)


def boxes(ground, there):
    """Material → boxes in pixels of the frame."""
    told = {}
    for one in ground.patches(there):
        told.setdefault(int(one[KIND]), []).append(np.rint(one[LEFT:] / 84 * [160, 210, 160, 210]).astype(int).tolist())
    return told


def test_walls_and_bricks_are_rectangles_of_their_colour(ground):
    assert boxes(ground, ground.begin()) == {0: [[0, 10, 160, 20], [0, 20, 8, 210]], 1: [[8, 60, 152, 66]]}
    patches = ground.patches(ground.begin())
    assert patches.shape[1] == COLUMNS and (patches[:, STILL] == GROUND).all()
    assert (np.diff(patches[:, ID]) > 0).all()


def test_a_brick_that_is_taken_away_parts_its_row(ground):
    frame = picture()
    frame[60:66, 40:48] = OPEN
    there = ground.look(ground.begin(), frame)
    assert boxes(ground, there)[1] == [[8, 60, 40, 66], [48, 60, 152, 66]]
    assert boxes(ground, ground.look(there, picture())) == boxes(ground, ground.begin())  # a new wall of bricks


@pytest.mark.parametrize("gone", [False, True])
def test_what_is_hidden_is_as_it_was(ground, gone):
    frame = picture()
    frame[60:66, 40:48] = OPEN if gone else BRICK
    there = ground.look(ground.begin(), frame)
    frame[58:64, 42:46] = BALL
    np.testing.assert_array_equal(ground.look(there, frame), there)


def test_the_oracle_every_pixel_of_the_ground_is_in_one_rectangle(ground):
    rng = np.random.default_rng(0)
    for _ in range(5):
        frame = picture()
        for _ in range(20):
            top, left = rng.integers(10, 60), rng.integers(0, 150)
            frame[top : top + 6, left : left + 8] = OPEN
        there = ground.look(ground.begin(), frame)
        np.testing.assert_array_equal(there, (frame != OPEN).any(axis=2))
        covered = np.zeros(there.shape, int)
        for material in boxes(ground, there).values():
            for left, top, right, bottom in material:
                covered[top:bottom, left:right] += 1
        assert covered.max() == 1 and not (covered > there).any()
        assert there.sum() - covered.sum() < 24 * 40  # crumbs are left out


def test_a_background_of_one_colour_has_no_ground():
    plain = Ground(np.zeros((84, 84, 1), np.uint8), 12)
    assert len(plain.patches(plain.begin())) == 0
