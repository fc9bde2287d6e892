"""Compiled grey images, against OpenCV to the last bit."""

import cv2
import numpy as np
import pytest

from semrl.core import IMAGE_SIZE_PX
from semrl.perception.detection.grey import to_grey

SIZES = [(210, 160), (250, 160), (84, 85), (168, 84), (168, 168), (97, 300), (50, 200), (84, 84), (1, 1)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", ["noise", "blocks", "one colour"])
def test_it_is_what_opencv_makes(size: tuple[int, int], kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(4):
        frame = rng.integers(0, 256, (*size, 3)).astype(np.uint8)
        if kind == "blocks":  # many lines like the one above them, sums that end in one half
            frame = np.repeat(frame[::7] // 128 * 255, 7, axis=0)[: size[0]]
        if kind == "one colour":
            frame[:] = frame[0, 0]
        small = cv2.resize(frame, (IMAGE_SIZE_PX, IMAGE_SIZE_PX), interpolation=cv2.INTER_AREA)
        np.testing.assert_array_equal(to_grey(frame), cv2.cvtColor(small, cv2.COLOR_RGB2GRAY))


def test_a_frame_need_not_lie_in_one_piece() -> None:
    frame = np.random.default_rng(1).integers(0, 256, (160, 210, 3)).astype(np.uint8)
    turned = frame.transpose(1, 0, 2)
    np.testing.assert_array_equal(to_grey(turned), to_grey(turned.copy()))
