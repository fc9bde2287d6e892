import numpy as np
import pytest

from semrl.core.errors import DataError, UsageError
from semrl.perception.detection import ForegroundConfig, ForegroundDetector

WALL, BALL, PADDLE = (236, 236, 236), (236, 236, 236), (92, 186, 92)


def frame(ball=None, paddle=None):
    """A frame of 210×160 with a wall; a ball of 4×2 and a paddle of 16×4 pixels, placed by their left upper corners."""
    shown = np.zeros((210, 160, 3), np.uint8)
    shown[24:34] = WALL
    for place, colour, (height, width) in ((paddle, PADDLE, (16, 4)), (ball, BALL, (4, 2))):
        if place:
            shown[place[0] : place[0] + height, place[1] : place[1] + width] = colour
    return shown


@pytest.fixture(scope="module")
def detector():
    learned = ForegroundDetector(ForegroundConfig(background_frames=30))
    for i in range(30):
        learned.partial_fit(frame(ball=(40 + 4 * i, 10 + 4 * i)))
    return learned


def test_the_background_is_what_is_there_most_of_the_time(detector):
    assert detector.is_fitted
    np.testing.assert_array_equal(detector.background_, frame())
    assert len(detector.detect(frame())) == 0
    detector.partial_fit(frame(paddle=(90, 100)))  # it has seen enough
    np.testing.assert_array_equal(detector.background_, frame())


@pytest.mark.parametrize("place", [(40, 30), (41, 31), (111, 90), (205, 157)])
def test_centres_are_exact_to_a_fraction_of_a_pixel(detector, place):
    objects = detector.detect(frame(ball=place))
    expected = ((place[0] + 2) * 84 / 210 - 0.5, (place[1] + 1) * 84 / 160 - 0.5)
    np.testing.assert_allclose(objects.centres_px, [expected], atol=1e-5)
    top, left, height, width = objects.boxes_px[0]
    assert top <= expected[0] + 0.5 <= top + height and left <= expected[1] + 0.5 <= left + width
    assert set(np.unique(objects.labels)) == {0, 1} and objects.labels[top, left : left + width].any()


def test_what_touches_in_another_colour_stays_apart(detector):
    """A ball on a paddle is two objects; the detector of §3.2.1 sees one."""
    objects = detector.detect(frame(ball=(95, 98), paddle=(90, 100)))
    assert len(objects) == 2
    columns = np.array([99, 102]) * 84 / 160 - 0.5
    np.testing.assert_allclose(np.sort(objects.centres_px[:, 1]), columns, rtol=1e-6)


def test_what_lies_on_the_background_in_its_colour_is_seen_in_part(detector):
    objects = detector.detect(frame(ball=(32, 50)))  # half inside the wall
    assert len(objects) == 1 and objects.centres_px[0, 0] == pytest.approx((34 + 1) * 84 / 210 - 0.5)


def test_crops_do_not_change_with_the_place(detector):
    crops = [detector.detect(frame(ball=place)).crops[0] for place in ((40, 30), (41, 30), (42, 31), (43, 33))]
    for crop in crops[1:]:
        np.testing.assert_allclose(crop, crops[0], atol=1e-6)
    ball, paddle = detector.detect(frame(ball=(60, 20), paddle=(90, 100))).crops
    assert np.linalg.norm(ball - paddle) > 1


def test_black_objects_are_seen_too():
    grey = np.full((84, 84), 120, np.uint8)
    learned = ForegroundDetector().partial_fit(grey)
    grey = grey.copy()
    grey[10:13, 20:24] = 0
    (crop,) = learned.detect(grey).crops
    assert crop.sum() == pytest.approx(12 / 5)


def test_the_smallest_are_left_out_where_there_are_too_many(detector):
    few = ForegroundDetector(ForegroundConfig(max_objects=1))
    few.from_arrays(detector.to_arrays())
    (centre,) = few.detect(frame(ball=(60, 20), paddle=(90, 100))).centres_px
    assert centre[1] == pytest.approx(102 * 84 / 160 - 0.5)


def test_what_does_not_fit_is_refused(detector):
    with pytest.raises(DataError, match="first"):
        ForegroundDetector().detect(frame())
    with pytest.raises(DataError, match="the background is of frames"):
        detector.detect(np.zeros((84, 84, 3), np.uint8))
    with pytest.raises(DataError, match="expected a frame"):
        detector.detect(np.zeros((210, 160, 3), np.float32))
    for wrong in ({"background_frames": 0}, {"max_objects": 0}, {"contrast": 255}, {"parts_share": 0}):
        with pytest.raises(UsageError):
            ForegroundConfig(**wrong)
