"""The threshold by its definition, components by their neighbours, and the objects of a real frame."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semrl.core.errors import DataError, UsageError
from semrl.envs import Game, make_env
from semrl.perception.detection import DetectionConfig, OtsuDetector
from semrl.perception.detection.grey import to_grey


def between_class_variances(image):
    """Otsu's criterion for each threshold 0 … 254, by two masks (NaN where one class is empty)."""
    values = image.ravel().astype(float)
    result = np.full(255, np.nan)
    for threshold in range(255):
        low = values[values <= threshold]
        high = values[values > threshold]
        if len(low) and len(high):
            shares = len(low) * len(high) / len(values) ** 2
            result[threshold] = shares * (high.mean() - low.mean()) ** 2
    return result


def detector_with(threshold):
    detector = OtsuDetector()
    detector.from_arrays({"thresholds": np.full(50, threshold / 0.9)})
    return detector


def two_greys(seed):
    rng = np.random.default_rng(seed)
    image = rng.normal(60, 15, (84, 84))
    image[:20] = rng.normal(170, 20, (20, 84))
    return image.clip(0, 255).astype(np.uint8)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**31), st.sampled_from(["two greys", "noise", "few levels"]))
def test_the_threshold_maximises_the_variance_between_the_classes(seed, kind):
    rng = np.random.default_rng(seed)
    image = {
        "two greys": lambda: two_greys(seed),
        "noise": lambda: rng.integers(256, size=(84, 84), dtype=np.uint8),
        "few levels": lambda: rng.choice(rng.integers(256, size=5, dtype=np.uint8), (84, 84)),
    }[kind]()
    variances = between_class_variances(image)
    found = OtsuDetector().partial_fit(image).thresholds_[0]
    assert variances[int(found)] == pytest.approx(np.nanmax(variances), rel=1e-6)


def test_the_threshold_is_lowered_by_ten_percent():
    detector = OtsuDetector(DetectionConfig(threshold_frames=1)).partial_fit(two_greys(0))
    assert detector.threshold_ == pytest.approx(0.9 * detector.thresholds_[0])
    just_above = np.zeros((84, 84), np.uint8)
    just_above[5, 5] = int(detector.threshold_) + 1
    just_above[9, 9] = int(detector.threshold_)
    assert detector.detect(just_above).boxes_px.tolist() == [[5, 5, 1, 1]]


def test_the_threshold_is_found_once_from_the_first_frames():
    detector = OtsuDetector(DetectionConfig(threshold_frames=5))
    images = [two_greys(i) // (1 + i % 2) for i in range(5)]
    for image in images:
        assert not detector.is_fitted
        detector.partial_fit(image)
    assert detector.is_fitted
    found = [cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)[0] for image in images]
    assert detector.threshold_ == pytest.approx(0.9 * np.median(found))
    before = detector.threshold_
    for _ in range(10):
        detector.partial_fit(np.full((84, 84), 255, np.uint8))
        detector.detect(two_greys(9))
    assert detector.threshold_ == before and len(detector.thresholds_) == 5


def flood(foreground):
    """Components by walking from pixel to pixel over all eight neighbours."""
    left, found = {*zip(*map(tuple, np.nonzero(foreground)), strict=True)}, set()
    while left:
        todo, component = [left.pop()], set()
        while todo:
            row, column = todo.pop()
            component.add((row, column))
            near = {(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & left
            left -= near
            todo += near
        found.add(frozenset(component))
    return found


@pytest.mark.parametrize("share", [0.02, 0.2, 0.4])
def test_components_are_joined_over_corners(share):
    image = (np.random.default_rng(0).random((84, 84)) < share).astype(np.uint8) * 200
    labels = detector_with(100).components(image)
    assert labels.dtype == np.int32
    found = {frozenset(zip(*map(tuple, np.nonzero(labels == i)), strict=True)) for i in range(1, labels.max() + 1)}
    assert found == flood(image)


def test_components_are_not_cut_but_objects_are():
    image = np.zeros((84, 84), np.uint8)
    image[40:44] = 200
    detector = detector_with(100)
    assert detector.components(image).max() == 1
    assert len(detector.detect(image)) == 11


@pytest.fixture(scope="module")
def pong():
    """Images of Pong in play and a detector that has seen them."""
    game = Game(make_env("PongNoFrameskip-v4"), seed=0)
    game.reset()
    images = [to_grey(game.step(i // 5 % 2).observation.frame) for i in range(80)]
    detector = OtsuDetector()
    for image in images:
        detector.partial_fit(image)
    return detector, images


def test_the_objects_of_a_pong_frame(pong):
    detector, images = pong
    image = images[-1]
    labels = detector.components(image)
    objects = detector.detect(image)
    rows, columns = objects.centres_px.T
    heights, widths = objects.boxes_px[:, 2:].T

    def number(where):
        return int(where.sum())

    in_field = (rows > 15) & (rows < 76)
    # Both walls reach over the whole width: 84 px make 11 pieces of 7 or 8 px each.
    assert number((rows > 76) & (widths >= 7)) == 11
    assert number((rows > 8) & (rows < 15) & (widths >= 7)) == 11
    # Paddles are about 2 × 7 px at both sides, the ball a speck between them; digits are above the field.
    paddles = objects.boxes_px[in_field & ((columns < 12) | (columns > 72))]
    assert len(paddles) == 2 and (paddles[:, 2] >= 6).all() and (paddles[:, 3] <= 3).all()
    ball = in_field & (columns > 12) & (columns < 72)
    assert number(ball) == 1 and (heights[ball] <= 4).all() and (widths[ball] <= 3).all()
    assert labels.max() == 7  # two digits, two walls, two paddles, ball
    assert number(rows < 8) >= 2


def test_the_ball_is_where_the_ram_says(pong):
    detector, _ = pong
    game = Game(make_env("PongNoFrameskip-v4"), seed=0)
    game.reset()
    found = 0
    for i in range(120):
        observation = game.step(i // 7 % 2).observation
        objects = detector.detect(to_grey(observation.frame))
        rows, columns = objects.centres_px.T
        ball = (rows > 16) & (rows < 75) & (columns > 12) & (columns < 72)
        if ball.sum() != 1:
            continue
        found += 1
        # RAM → corner in the frame → centre of the ball → 84 px.
        row, column = int(observation.ram[54]) - 48 + 34, int(observation.ram[49]) - 49
        expected = (row + 2) * 84 / 210 - 0.5, (column + 1) * 84 / 160 - 0.5
        np.testing.assert_allclose(objects.centres_px[ball][0], expected, atol=1.0)
    assert found > 40


@pytest.mark.parametrize("level", [0, 1, 255])
def test_plain_images_do_not_break_anything(level):
    image = np.full((84, 84), level, np.uint8)
    detector = OtsuDetector(DetectionConfig(threshold_frames=1)).partial_fit(image)
    objects = detector.detect(image)
    assert objects.crops.shape == (len(objects), 8, 8)
    assert (objects.labels > 0).all() == (level > 0)
    assert len(objects) == (121 if level else 0)  # 11 × 11 pieces of 7 or 8 px
    assert len(detector.detect(np.zeros((84, 84), np.uint8))) == 0


def test_very_many_objects_do_not_break_anything():
    checkerboard = (np.indices((84, 84)).sum(axis=0) % 2 * 200).astype(np.uint8)
    specks = np.zeros((84, 84), np.uint8)
    specks[::2, ::2] = 200
    detector = detector_with(100)
    assert len(detector.detect(checkerboard)) == 121  # corners touch: one component
    assert len(detector.detect(specks)) == 42 * 42  # no image has more components
    one_pixel = OtsuDetector(DetectionConfig(threshold_frames=1, max_object_share=1 / 84)).partial_fit(checkerboard)
    assert len(one_pixel.detect(np.full((84, 84), 250, np.uint8))) == 84 * 84


def test_images_are_left_alone():
    image = two_greys(0)
    image.flags.writeable = False
    detector = OtsuDetector().partial_fit(image)
    detector.detect(image)
    detector.components(image)
    np.testing.assert_array_equal(image, two_greys(0))


def test_the_largest_object_is_a_tenth_of_the_image():
    assert OtsuDetector().crop_size_px == 8
    assert OtsuDetector(DetectionConfig(max_object_share=0.25)).crop_size_px == 21


def test_nothing_is_detected_before_the_first_image():
    with pytest.raises(DataError, match="partial_fit first"):
        OtsuDetector().detect(two_greys(0))


@pytest.mark.parametrize("image", [np.zeros((84, 83), np.uint8), np.zeros((84, 84)), np.zeros(84, np.uint8)])
def test_what_is_no_grey_image_is_refused(image):
    for method in (OtsuDetector().partial_fit, detector_with(100).detect, detector_with(100).components):
        with pytest.raises(DataError, match="grey image"):
            method(image)


@pytest.mark.parametrize(
    "values",
    [
        {"threshold_share": 0.0},
        {"threshold_share": 1.1},
        {"threshold_frames": 0},
        {"max_object_share": 0.01},
        {"max_object_share": 1.5},
    ],
)
def test_impossible_settings_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        DetectionConfig(**values)
