"""Cutting large components into parts of equal size (§3.2.1, Fig. 3.4)."""

import functools

import numpy as np
from numpy.typing import NDArray

from semrl.types import Image, Ints, Objects


@functools.cache
def n_parts(length_px: int, limit_px: int) -> int:
    """Return into how many parts a length is cut: as few as possible, of the same size, within the limit.

    A length that has no such divisor (a prime, say) is cut into parts that differ by one pixel, rather
    than into slivers.
    """
    fewest = -(-length_px // limit_px)
    return next((n for n in range(fewest, 2 * fewest + 1) if length_px % n == 0), fewest)


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
    pixels = np.stack(np.nonzero(labels))  # (2, p): row and column of each foreground pixel
    rows, cols = pixels
    owner = labels[rows, cols].astype(np.int64) - 1  # (p,) the component of each of them
    for axis in (1, 0):
        owner, boxes_px = _split(owner, boxes_px, pixels, axis, limit_px)
    top, left, height, width = boxes_px.T
    crops = np.zeros((len(boxes_px), limit_px, limit_px), dtype=np.float32)
    # An odd gap leaves the object half a pixel up and left of the window's middle.
    crop_rows = rows - (top - (limit_px - height) // 2)[owner]
    crop_cols = cols - (left - (limit_px - width) // 2)[owner]
    crops[owner, crop_rows, crop_cols] = image[rows, cols] / np.float32(255)
    pieces = np.zeros_like(labels)
    pieces[rows, cols] = owner + 1
    centres = np.stack([top + (height - 1) / 2, left + (width - 1) / 2], axis=1)
    return Objects(crops=crops, centres_px=centres.astype(np.float32), boxes_px=boxes_px, labels=pieces)


def _split(owner: Ints, boxes_px: Ints, pixels: Ints, axis: int, limit_px: int) -> tuple[Ints, Ints]:
    """Split every object along one axis; return each pixel's new owner and the new objects' tight boxes."""
    start, length = boxes_px[:, axis], boxes_px[:, axis + 2]
    parts = np.array([n_parts(size, limit_px) for size in length.tolist()], dtype=np.int64)
    first = np.cumsum(parts) - parts  # number of each object's first piece
    piece = first[owner] + (pixels[axis] - start[owner]) * parts[owner] // length[owner]
    # Inside an object of several arms a piece may be empty: number only those with pixels.
    found, owner = np.unique(piece, return_inverse=True)
    low = np.full((2, len(found)), np.iinfo(np.int64).max)
    high = np.full((2, len(found)), -1)
    for i in range(2):
        np.minimum.at(low[i], owner, pixels[i])
        np.maximum.at(high[i], owner, pixels[i])
    return owner, np.concatenate([low, high - low + 1]).T
