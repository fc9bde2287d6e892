"""Compiled components, against OpenCV: the same labels, the same numbers, the same boxes."""

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semrl.perception.detection.components import connected_components


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 2**32 - 1), st.integers(1, 84), st.integers(1, 84), st.integers(1, 6), st.floats(0, 255))
def test_they_are_those_of_opencv(seed: int, height: int, width: int, blur: int, threshold: float) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)
    image = cv2.normalize(cv2.blur(image, (blur, blur)), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats((image > threshold).astype(np.uint8), connectivity=8)
    found = connected_components(image, threshold)
    np.testing.assert_array_equal(found.labels, labels)
    order = [cv2.CC_STAT_TOP, cv2.CC_STAT_LEFT, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_WIDTH]
    np.testing.assert_array_equal(found.boxes_px, stats[1:count, order])
    np.testing.assert_array_equal(found.labels[tuple(found.places_px.T)], found.owners + 1)
    assert len(found.owners) == np.count_nonzero(labels)


def test_every_second_pixel_is_a_component_and_every_pixel_of_a_checkerboard_is_one() -> None:
    dots, board = np.zeros((2, 84, 84), np.uint8)
    dots[::2, ::2] = 255
    board[np.indices((84, 84)).sum(axis=0) % 2 == 0] = 255
    assert len(connected_components(dots, 100.0).boxes_px) == 42 * 42
    assert connected_components(board, 100.0).boxes_px.tolist() == [[0, 0, 84, 84]]
