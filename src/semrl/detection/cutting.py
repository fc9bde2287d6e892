"""Cutting large components into parts of equal size (§3.2.1, Fig. 3.4)."""

import functools

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semrl.types import IMAGE_SIZE_PX, Floats, Image, Ints, Objects

FARTHEST_PX = 1 << 30

compiled = njit(cache=True, nogil=True)

_SHARES = np.arange(256, dtype=np.float32) / np.float32(255)
"""Grey levels as shares of white."""


@functools.cache
def n_parts(length_px: int, limit_px: int) -> int:
    """Return into how many parts a length is cut: as few as possible, of the same size, within the limit.

    A length that has no such divisor (a prime, say) is cut into parts that differ by one pixel, rather
    than into slivers.
    """
    fewest = -(-length_px // limit_px)
    return next((n for n in range(fewest, 2 * fewest + 1) if length_px % n == 0), fewest)


@functools.cache
def parts_table(limit_px: int) -> Ints:
    """Return `n_parts` of every length that an image can have, ``(85,)``; 1 for nothing."""
    return np.array([1] + [n_parts(length, limit_px) for length in range(1, IMAGE_SIZE_PX + 1)])


def cut_components(image: Image, labels: NDArray[np.int32], boxes_px: Ints, limit_px: int) -> Objects:
    """Cut components first along the row, then each new piece along the column where it is still too large.

    Every piece is measured anew before the second cut: where a paddle touches a wall only the piece
    with the paddle is cut.

    Parameters
    ----------
    image
        ``(84, 84)`` uint8.
    labels
        ``(84, 84)`` int32, number of the component of each pixel; 0 is background.
    boxes_px
        ``(c, 4)``, top, left, height and width of each component.
    limit_px
        Largest height and width of an object.
    """
    boxes, crops, centres, pieces = _cut(image, labels, boxes_px, limit_px, parts_table(limit_px))
    return Objects(crops=crops, centres_px=centres, boxes_px=boxes, labels=pieces)


@compiled
def _cut(
    image: Image, labels: NDArray[np.int32], boxes: Ints, limit_px: int, parts_of: Ints
) -> tuple[Ints, Floats, Floats, NDArray[np.int32]]:
    """Return boxes, crops, centres and labels of the pieces."""
    places, owners = _pixels(labels)
    for axis in (1, 0):
        boxes = _split(places, owners, boxes, axis, parts_of)
    crops = np.zeros((len(boxes), limit_px, limit_px), np.float32)
    centres = np.empty((len(boxes), 2), np.float32)
    origins = np.empty((len(boxes), 2), np.int64)  # the pixel in the corner of each window
    for i in range(len(boxes)):
        for axis in range(2):
            start, length = boxes[i, axis], boxes[i, axis + 2]
            centres[i, axis] = start + (length - 1) / 2
            # An odd gap leaves the object half a pixel up and left of the window's middle.
            origins[i, axis] = start - (limit_px - length) // 2
    pieces = np.zeros_like(labels)
    for p in range(len(owners)):
        row, column, owner = places[p, 0], places[p, 1], owners[p]
        crops[owner, row - origins[owner, 0], column - origins[owner, 1]] = _SHARES[image[row, column]]
        pieces[row, column] = owner + 1
    return boxes, crops, centres, pieces


@compiled
def _pixels(labels: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return row and column of each foreground pixel, ``(p, 2)``, and the component it belongs to, ``(p,)``."""
    places = np.empty((labels.size, 2), np.int32)
    owners = np.empty(labels.size, np.int32)
    count = 0
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            if labels[row, column]:
                places[count, 0], places[count, 1] = row, column
                owners[count] = labels[row, column] - 1
                count += 1
    return places[:count], owners[:count]


@compiled
def _split(
    places: NDArray[np.int32], owners: NDArray[np.int32], boxes: Ints, axis: int, parts_of: Ints
) -> Ints:
    """Split every object along one axis: change each pixel's owner and return the new objects' tight boxes."""
    starts = boxes[:, axis].astype(np.int32)
    lengths = boxes[:, axis + 2].astype(np.int32)
    parts = parts_of[lengths].astype(np.int32)
    first = np.cumsum(parts) - parts  # number of each object's first piece
    numbers = np.zeros(parts.sum() + 1, np.int32)
    for p in range(len(owners)):
        owner = owners[p]
        piece = first[owner]
        if parts[owner] > 1:
            piece += (places[p, axis] - starts[owner]) * parts[owner] // lengths[owner]
        owners[p] = piece
        numbers[piece] = 1
    # Inside an object of several arms a piece may be empty: number only those with pixels.
    numbers = np.cumsum(numbers) - 1
    tight = np.empty((numbers[-1] + 1, 4), np.int64)
    tight[:, :2], tight[:, 2:] = FARTHEST_PX, -1
    for p in range(len(owners)):
        owners[p] = numbers[owners[p]]
        box = tight[owners[p]]
        for side in range(2):
            box[side] = min(box[side], places[p, side])
            box[side + 2] = max(box[side + 2], places[p, side])
    tight[:, 2:] += 1 - tight[:, :2]
    return tight
