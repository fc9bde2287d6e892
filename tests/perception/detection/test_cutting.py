"""Cutting, against its definition pixel by pixel."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semrl.perception.detection.components import connected_components
from semrl.perception.detection.cutting import cut_components, n_parts

LIMIT_PX = 8


def components(foreground):
    _, labels, stats, _ = cv2.connectedComponentsWithStats(foreground.astype(np.uint8), connectivity=8)
    boxes = stats[1:, [cv2.CC_STAT_TOP, cv2.CC_STAT_LEFT, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_WIDTH]]
    return labels, boxes.astype(np.int64)


def cut(image):
    return cut_components(image, connected_components(image, 0), LIMIT_PX)


def block(*rectangles):
    image = np.zeros((84, 84), np.uint8)
    for top, left, height, width in rectangles:
        image[top : top + height, left : left + width] = 100 + top
    return image


@st.composite
def images(draw):
    """Bars and specks: large components of any shape, and many small ones."""
    image = np.zeros((84, 84), np.uint8)
    place = st.integers(0, 83)
    for _ in range(draw(st.integers(0, 5))):
        top, left, height, width = (draw(place) for _ in range(4))
        image[top : top + height + 1, left : left + width // 2 + 1] = draw(st.integers(1, 255))
    for row, column in draw(st.lists(st.tuples(place, place), max_size=20)):
        image[row, column] = draw(st.integers(1, 255))
    return image


@pytest.mark.parametrize("limit_px", range(1, 20))
def test_parts_are_as_few_as_can_be(limit_px):
    for length_px in range(1, 85):
        assert n_parts(length_px, limit_px) == min(n for n in range(1, 85) if -(-length_px // n) <= limit_px)


def test_examples_of_parts():
    assert [n_parts(n, 8) for n in (1, 8, 9, 10, 16, 17, 84)] == [1, 1, 2, 2, 2, 3, 11]


@settings(deadline=None, max_examples=60)
@given(images())
def test_every_pixel_belongs_to_one_object_within_bounds(image):
    kept = image.copy()
    objects = cut(image)
    np.testing.assert_array_equal(image, kept)
    np.testing.assert_array_equal(objects.labels > 0, image > 0)
    assert set(np.unique(objects.labels)) - {0} == set(range(1, len(objects) + 1))
    before = components(image > 0)[0]
    for i, (top, left, height, width) in enumerate(objects.boxes_px):
        rows, columns = np.nonzero(objects.labels == i + 1)
        assert len({*before[rows, columns]}) == 1  # an object comes from one component
        assert (rows.min(), columns.min(), np.ptp(rows) + 1, np.ptp(columns) + 1) == (top, left, height, width)
        assert 1 <= height <= LIMIT_PX and 1 <= width <= LIMIT_PX
        np.testing.assert_allclose(objects.centres_px[i], [top + (height - 1) / 2, left + (width - 1) / 2])


@settings(deadline=None, max_examples=60)
@given(images())
def test_crops_hold_the_objects_pixels_centred(image):
    objects = cut(image)
    assert objects.crops.shape == (len(objects), LIMIT_PX, LIMIT_PX) and objects.crops.dtype == np.float32
    for i, (top, left, height, width) in enumerate(objects.boxes_px):
        expected = np.zeros((LIMIT_PX, LIMIT_PX), np.float32)
        above, before = (LIMIT_PX - height) // 2, (LIMIT_PX - width) // 2
        window = slice(top, top + height), slice(left, left + width)
        own = np.where(objects.labels[window] == i + 1, image[window], 0) / np.float32(255)
        expected[above : above + height, before : before + width] = own
        np.testing.assert_array_equal(objects.crops[i], expected)


@settings(deadline=None, max_examples=60)
@given(images())
def test_first_along_the_row_then_each_piece_along_the_column(image):
    labels, boxes = components(image > 0)
    expected = set()
    for i, (_, left, _, width) in enumerate(boxes):
        strips = n_parts(int(width), LIMIT_PX)
        for strip in range(strips):
            inside = (labels == i + 1) & ((np.arange(84) - left) * strips // width == strip)
            rows = np.flatnonzero(inside.any(axis=1))
            if not len(rows):
                continue
            height = np.ptp(rows) + 1
            slabs = n_parts(int(height), LIMIT_PX)
            for slab in range(slabs):
                piece = inside & ((np.arange(84)[:, None] - rows[0]) * slabs // height == slab)
                expected.add(frozenset(zip(*map(tuple, np.nonzero(piece)), strict=True)))
    cut_labels = cut(image).labels
    found = {
        frozenset(zip(*map(tuple, np.nonzero(cut_labels == i)), strict=True)) for i in range(1, cut_labels.max() + 1)
    }
    assert found == expected - {frozenset()}


@pytest.mark.parametrize(("height", "width"), [(10, 80), (24, 3), (16, 16), (72, 72), (8, 14)])
def test_rectangles_become_equal_rectangles(height, width):
    objects = cut(block((0, 0, height, width)))
    assert len({(h, w) for _, _, h, w in objects.boxes_px.tolist()}) == 1
    assert len(objects) == n_parts(height, LIMIT_PX) * n_parts(width, LIMIT_PX)


@pytest.mark.parametrize("length_px", [83, 84])
def test_what_cannot_be_cut_evenly_has_parts_that_differ_by_one_pixel(length_px):
    heights = cut(block((0, 0, length_px, 1))).boxes_px[:, 2]
    assert len(heights) == 11 and set(heights.tolist()) == {7, 8} and heights.sum() == length_px


def test_what_is_small_enough_stays_whole():
    objects = cut(block((10, 10, 8, 8), (30, 30, 1, 1)))
    assert objects.boxes_px.tolist() == [[10, 10, 8, 8], [30, 30, 1, 1]]


def test_only_the_strip_with_the_paddle_is_cut_again():
    objects = cut(block((70, 0, 4, 80), (50, 12, 20, 4)))  # a paddle stands on a wall of 10 strips
    columns, counts = np.unique(objects.boxes_px[:, 1], return_counts=True)
    assert len(objects) == 9 + 3
    assert dict(zip(columns.tolist(), counts.tolist(), strict=True))[0] == 1


def test_an_odd_gap_leaves_the_object_up_and_left():
    crop = cut(block((10, 10, 3, 3))).crops[0]
    assert np.flatnonzero(crop.any(axis=1)).tolist() == np.flatnonzero(crop.any(axis=0)).tolist() == [2, 3, 4]


@settings(deadline=None, max_examples=20)
@given(arrays(np.bool_, (84, 84)))
def test_noise_is_cut_as_well(foreground):
    objects = cut(foreground.astype(np.uint8))
    assert objects.labels.astype(bool).sum() == foreground.sum()
    assert len(objects) == 0 or objects.boxes_px[:, 2:].max() <= LIMIT_PX


def test_components_are_left_alone():
    image = block((0, 0, 30, 30))
    components = connected_components(image, 0)
    kept = [array.copy() for array in components]
    cut_components(image, components, LIMIT_PX)
    for array, before in zip(components, kept, strict=True):
        np.testing.assert_array_equal(array, before)
