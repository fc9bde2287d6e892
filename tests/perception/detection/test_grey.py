"""The small grey image, worked out by hand: area means by overlap, luma by the weights of BT.601."""

import numpy as np
import pytest

from semrl.core.errors import DataError
from semrl.perception.detection.grey import to_grey

BT_601 = np.array([0.299, 0.587, 0.114])


def area_weights(size):
    """Share of each old pixel in each of 84 new ones, (84, size): the overlap of the two intervals."""
    scale = size / 84
    new, old = np.arange(84)[:, None] * scale, np.arange(size)
    overlap = np.minimum(new + scale, old + 1) - np.maximum(new, old)
    return overlap.clip(0) / scale


def by_hand(frame):
    rows, columns = (area_weights(size) for size in frame.shape[:2])
    small = np.einsum("ir,rcn,jc->ijn", rows, frame.astype(float), columns, optimize=True)
    return small @ BT_601


@pytest.mark.parametrize("shape", [(210, 160), (168, 168), (84, 84), (250, 100)])
def test_grey_is_the_area_mean_by_bt_601(shape):
    frame = np.random.default_rng(0).integers(256, size=(*shape, 3), dtype=np.uint8)
    kept = frame.copy()
    image = to_grey(frame)
    assert image.shape == (84, 84) and image.dtype == np.uint8
    np.testing.assert_allclose(image, by_hand(frame), atol=1.01)  # two roundings: after the mean, after the luma
    np.testing.assert_array_equal(frame, kept)


def test_a_plain_colour_keeps_its_luma():
    for colour in [(255, 0, 0), (0, 255, 0), (0, 0, 255), (236, 236, 236), (92, 186, 92)]:
        image = to_grey(np.full((210, 160, 3), colour, dtype=np.uint8))
        assert np.unique(image).tolist() == [round(float(BT_601 @ colour))]


def test_red_and_blue_are_not_swapped():
    red, blue = (to_grey(np.full((84, 84, 3), c, dtype=np.uint8)).max() for c in [(255, 0, 0), (0, 0, 255)])
    assert (red, blue) == (76, 29)


def test_a_view_of_a_frame_gives_the_same_image():
    frame = np.random.default_rng(0).integers(256, size=(210, 160, 3), dtype=np.uint8)
    wide = np.zeros((210, 320, 3), dtype=np.uint8)
    wide[:, ::2] = frame
    np.testing.assert_array_equal(to_grey(wide[:, ::2]), to_grey(frame))


@pytest.mark.parametrize(
    "frame",
    [
        np.zeros((84, 84), np.uint8),
        np.zeros((84, 84, 4), np.uint8),
        np.zeros((84, 84, 3), np.float32),
        np.zeros((0, 84, 3), np.uint8),
        np.zeros(5, np.uint8),
    ],
)
def test_what_is_no_rgb_frame_is_refused(frame):
    with pytest.raises(DataError, match="RGB frame"):
        to_grey(frame)
