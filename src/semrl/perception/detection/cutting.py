"""Cutting large components into parts of equal size (§3.2.1, Fig. 3.4)."""

import functools

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Image, Ints, Objects
from semrl.core.kernels import compiled
from semrl.perception.detection.components import Components, tight_boxes

_SHARES_OF_WHITE = np.arange(256, dtype=np.float32) / np.float32(255)


@functools.cache
def n_parts(length_px: int, limit_px: int) -> int:
    """Return into how many parts a length is cut: as few as the limit allows; they differ by one pixel at most."""
    return -(-length_px // limit_px)


@functools.cache
def parts_table(limit_px: int) -> Ints:
    """Return `n_parts` of every length that an image can have, ``(85,)``; 1 for nothing."""
    return np.array([1] + [n_parts(length, limit_px) for length in range(1, IMAGE_SIZE_PX + 1)])


def cut_components(image: Image, components: Components, limit_px: int) -> Objects:
    """Cut components first along the row, then each new piece along the column where it is still too large.

    Every piece is measured anew before the second cut: where a paddle touches a wall only the piece
    with the paddle is cut.

    Parameters
    ----------
    image
        ``(84, 84)`` uint8.
    components
        Of this image.
    limit_px
        Largest height and width of an object.
    """
    boxes, crops, centres, labels = _cut(image, components, limit_px, parts_table(limit_px))
    return Objects(crops=crops, centres_px=centres, boxes_px=boxes, labels=labels)


@compiled
def _cut(
    image: Image, components: Components, limit_px: int, parts_of: Ints
) -> tuple[Ints, Floats, Floats, NDArray[np.int32]]:
    """Return boxes, crops, centres and labels of the pieces."""
    places, owners, boxes = components.places_px, components.owners, components.boxes_px
    for axis in (1, 0):
        owners, boxes = _split(places, owners, boxes, axis, parts_of)
    crops = np.zeros((len(boxes), limit_px, limit_px), np.float32)
    centres = np.empty((len(boxes), 2), np.float32)
    corners = np.empty((len(boxes), 2), np.int64)  # of each object's window
    for i in range(len(boxes)):
        for axis in range(2):
            start, length = boxes[i, axis], boxes[i, axis + 2]
            centres[i, axis] = start + (length - 1) / 2
            # An odd gap leaves the object half a pixel up and left of the window's middle.
            corners[i, axis] = start - (limit_px - length) // 2
    labels = np.zeros(image.shape, np.int32)
    for p in range(len(places)):
        row, column, owner = places[p, 0], places[p, 1], owners[p]
        crops[owner, row - corners[owner, 0], column - corners[owner, 1]] = _SHARES_OF_WHITE[image[row, column]]
        labels[row, column] = owner + 1
    return boxes, crops, centres, labels


@compiled
def _split(
    places: NDArray[np.int32], owners: NDArray[np.int32], boxes: Ints, axis: int, parts_of: Ints
) -> tuple[NDArray[np.int32], Ints]:
    """Split every object along one axis; return each pixel's new owner and the new objects' tight boxes."""
    lengths = boxes[:, axis + 2]
    if not len(boxes) or parts_of[lengths].max() == 1:
        return owners, boxes
    ends = np.cumsum(lengths)
    piece_at = np.empty(lengths.sum(), np.int64)  # of each place along each object
    pieces = 0
    for i in range(len(boxes)):
        parts = parts_of[lengths[i]]
        for offset in range(lengths[i]):
            piece_at[ends[i] - lengths[i] + offset] = pieces + (offset * parts // lengths[i] if parts > 1 else 0)
        pieces += parts
    zeros = ends - lengths - boxes[:, axis]  # where each object's place 0 would be
    split = np.empty_like(owners)
    used = np.zeros(pieces, np.int32)
    for p in range(len(owners)):
        split[p] = piece_at[zeros[owners[p]] + places[p, axis]]
        used[split[p]] = 1
    # Inside an object of several arms a piece may be empty: number only those with pixels.
    numbers = np.cumsum(used) - 1
    for p in range(len(owners)):
        split[p] = numbers[split[p]]
    return split, tight_boxes(places, split, used.sum())
