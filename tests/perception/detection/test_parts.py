import numpy as np
import pytest

from semrl.perception.detection import ForegroundConfig, ForegroundDetector
from semrl.perception.detection.parts import LEAST_PIECES, MOST_COLOURS

GROUND, BODY, OTHER_BODY, WHEEL, BALL = (90, 90, 90), (160, 40, 40), (40, 40, 160), (0, 0, 0), (236, 236, 236)
FRAMES = 4 * LEAST_PIECES


def car(shown, row, column, body):
    """Six pixels of body between two wheels."""
    shown[row : row + 3, column : column + 6] = body
    shown[row - 1, column + 1 : column + 3] = shown[row + 3, column + 1 : column + 3] = WHEEL


def street(i, ball=None):
    """Two cars of different colours, and a ball that meets the first now and then."""
    shown = np.full((84, 84, 3), GROUND, np.uint8)
    car(shown, 20, (i * 3) % 70, BODY)
    car(shown, 50, 70 - (i * 2) % 70, OTHER_BODY)
    row, column = ball or ((23, (i * 3) % 70 + 3) if i % 5 == 0 else (70, (7 * i) % 80))
    shown[row : row + 2, column : column + 2] = BALL
    return shown


@pytest.fixture(scope="module")
def learned():
    detector = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        detector.partial_fit(street(i))
    return detector


def test_what_always_touches_is_one_and_what_meets_now_and_then_is_not(learned):
    objects = learned.detect(street(7, ball=(23, 25)))  # on the first car's lower side
    assert len(objects) == 3
    np.testing.assert_allclose(objects.boxes_px[:, 2:], [[5, 6], [2, 2], [5, 6]])
    apart = ForegroundDetector(ForegroundConfig(background_frames=FRAMES, parts_share=1.1))
    for i in range(FRAMES):
        apart.partial_fit(street(i))
    assert len(apart.detect(street(7))) == 7  # two bodies, four wheels, a ball


def test_the_middle_of_a_thing_is_that_of_all_its_pixels(learned):
    objects = learned.detect(street(0, ball=(70, 40)))
    expected = (18 * 21 + 2 * 19 + 2 * 23) / 22, (18 * 2.5 + 4 * 1.5) / 22
    np.testing.assert_allclose(objects.centres_px[0], expected, rtol=1e-6)
    assert (np.unique(objects.labels) == np.arange(4)).all()


def sign(hole):
    """A sign with a hole that changes its place, and below it, at once, what was cut out."""
    shown = np.full((84, 84, 3), GROUND, np.uint8)
    shown[10:12, 10:22] = BODY
    shown[10:12, 10 + 2 * hole : 12 + 2 * hole] = GROUND
    shown[12:14, 10 + 2 * hole : 12 + 2 * hole] = BODY
    return shown


def test_the_colour_of_the_ground_is_no_part_of_anything():
    detector = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        shown = sign(i % 6)
        shown[15, i % 60 : i % 60 + 3] = BALL  # or it would be a display
        detector.partial_fit(shown)
    np.testing.assert_array_equal(detector.detect(sign(5)).boxes_px, [[12, 20, 2, 2]])


def stripes(i, gap):
    """A thing of three stripes with gaps, and another that comes near it now and then."""
    shown = np.full((84, 84, 3), GROUND, np.uint8)
    for stripe in range(3):
        row = 20 + stripe * (1 + gap)
        shown[row, i % 60 : i % 60 + 6] = BODY
    row = 24 + 2 * gap if i % 4 == 0 else 60
    shown[row, i % 60 : i % 60 + 3] = BALL
    return shown


@pytest.mark.parametrize(("gap", "found"), [(1, 2), (2, 4)])
def test_stripes_with_gaps_of_one_pixel_are_one(gap, found):
    detector = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        detector.partial_fit(stripes(i, gap))
    for i in (FRAMES, FRAMES + 1):
        assert len(detector.detect(stripes(i, gap))) == found


def test_rare_colours_are_not_judged_and_new_ones_go_together(learned):
    rare = ForegroundDetector(ForegroundConfig(background_frames=2 * LEAST_PIECES - 2))
    for i in range(2 * LEAST_PIECES - 2):
        rare.partial_fit(street(i, ball=(70, 40)))
    assert len(rare.detect(street(3, ball=(70, 40)))) == 6  # wheels are not rare, bodies are: nothing is joined
    shown = street(3, ball=(70, 40))
    shown[(shown == BODY).all(axis=2)] = (40, 160, 40)
    assert len(learned.detect(shown)) == 5  # new is the body alone
    shown[(shown == WHEEL).all(axis=2)] = (160, 160, 40)
    assert len(learned.detect(shown)) == 5  # one car is all new; of the other only the wheels


def village(i):
    """Two houses that pass by, each a black roof on a white wall, and a taller and a wider thing, black and white."""
    shown = np.full((84, 84, 3), GROUND, np.uint8)
    for row, column in ((10, i % 60), (30, (2 * i) % 60)):
        shown[row : row + 2, column + 1 : column + 5] = WHEEL
        shown[row + 2 : row + 6, column : column + 6] = BALL
    shown[50:55, (3 * i) % 70 : (3 * i) % 70 + 3] = WHEEL
    shown[70:72, (3 * i) % 70 : (3 * i) % 70 + 9] = BALL
    return shown


def test_pieces_of_one_size_are_parts_where_others_of_their_colour_are_not():
    detector = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        detector.partial_fit(village(i))
    np.testing.assert_array_equal(detector.detect(village(7)).boxes_px[:, 2:], [[6, 6], [6, 6], [5, 3], [2, 9]])


def test_what_was_learned_is_kept(learned):
    again = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    again.from_arrays(learned.to_arrays())
    for name in ("centres_px", "boxes_px", "labels", "crops"):
        np.testing.assert_array_equal(getattr(again.detect(street(9)), name), getattr(learned.detect(street(9)), name))
    halfway = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        halfway.partial_fit(street(i))
        if i == FRAMES * 3 // 4:
            kept = halfway.to_arrays()
            halfway = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
            halfway.from_arrays(kept)
    for name, array in learned.to_arrays().items():
        np.testing.assert_array_equal(halfway.to_arrays()[name], array)


def test_noise_of_all_colours_costs_no_more_than_its_largest_objects():
    rng = np.random.default_rng(1)
    detector = ForegroundDetector(ForegroundConfig(background_frames=20, max_objects=8))
    for _ in range(20):
        detector.partial_fit(rng.integers(0, 256, (60, 60, 3), dtype=np.uint8))
    arrays = detector.to_arrays()
    assert len(arrays["parts/colours"]) == MOST_COLOURS
    assert len(detector.detect(rng.integers(0, 256, (60, 60, 3), dtype=np.uint8))) == 8
