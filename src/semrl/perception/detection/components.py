"""Connected components of what is bright (§3.2.1), compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Image, Ints
from semrl.core.kernels import compiled

_FARTHEST_PX = 1 << 30


class Components(NamedTuple):
    """The components of one image."""

    labels: NDArray[np.int32]
    """``(height, width)`` int32, from 1 on; 0 is background."""
    boxes_px: Ints
    """``(c, 4)`` int64, top, left, height and width of each."""
    places_px: NDArray[np.int32]
    """``(p, 2)`` int32, row and column of every pixel of the foreground."""
    owners: NDArray[np.int32]
    """``(p,)`` int32, the component of each of these pixels, from 0 on."""


@compiled
def connected_components(image: Image, threshold: float) -> Components:
    """Number the components (8 neighbours) of the pixels above a threshold.

    They are numbered by the first block of 2×2 pixels that they touch, blocks taken from left to right and from
    top to bottom, which is how OpenCV numbers them: no two components touch the same block.

    Parameters
    ----------
    image
        ``(height, width)`` uint8.
    threshold
        In grey levels; what is above it is foreground.
    """
    labels, places, parents = _provisional_labels(image, threshold)
    owners = np.empty(len(places), np.int32)
    for p in range(len(places)):
        owners[p] = _root(parents, labels[places[p, 0], places[p, 1]])
    numbers, count = _numbers(places, owners, len(parents), image.shape)
    for p in range(len(places)):
        owners[p] = numbers[owners[p]]
        labels[places[p, 0], places[p, 1]] = owners[p] + 1
    return Components(labels, tight_boxes(places, owners, count), places, owners)


@compiled
def tight_boxes(places: NDArray[np.int32], owners: NDArray[np.int32], count: int) -> Ints:
    """Return top, left, height and width of so many objects, ``(count, 4)``, each of which has a pixel."""
    boxes = np.empty((count, 4), np.int64)
    boxes[:, :2], boxes[:, 2:] = _FARTHEST_PX, -1
    for p in range(len(places)):
        box = boxes[owners[p]]
        for axis in range(2):
            box[axis] = min(box[axis], places[p, axis])
            box[axis + 2] = max(box[axis + 2], places[p, axis])
    boxes[:, 2:] += 1 - boxes[:, :2]
    return boxes


@compiled
def _provisional_labels(
    image: Image, threshold: float
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Label each foreground pixel as one of its earlier neighbours, and write down which labels are one."""
    height, width = image.shape
    level = int(np.floor(threshold))  # grey levels are whole
    labels = np.zeros((height, width), np.int32)
    places = np.empty((height * width, 2), np.int32)
    parents = np.zeros(((height + 1) // 2) * ((width + 1) // 2) + 1, np.int32)
    found = count = 0
    for row in range(height):
        above = labels[max(row - 1, 0)]
        for column in range(width):
            if image[row, column] <= level:
                continue
            label = labels[row, column - 1] if column else 0
            for beside in range(max(column - 1, 0), min(column + 2, width) if row else 0):
                other = above[beside]
                if other and other != label:
                    label = _join(parents, other, label) if label else other
            if not label:
                count += 1
                parents[count] = count
                label = count
            labels[row, column] = label
            places[found, 0], places[found, 1] = row, column
            found += 1
    return labels, places[:found], parents[: count + 1]


@compiled
def _root(parents: NDArray[np.int32], label: int) -> int:
    while parents[label] != label:
        label = parents[label]
    return label


@compiled
def _join(parents: NDArray[np.int32], a: int, b: int) -> int:
    """Make two labels one; return the earlier root."""
    a, b = _root(parents, a), _root(parents, b)
    root = min(a, b)
    parents[a] = parents[b] = root
    return root


@compiled
def _numbers(
    places: NDArray[np.int32], roots: NDArray[np.int32], n_labels: int, shape: tuple[int, int]
) -> tuple[NDArray[np.int32], int]:
    """Return the number of each root, from 0 on in the order of first blocks, and how many there are."""
    blocks_in_a_row = (shape[1] + 1) // 2
    n_blocks = (shape[0] + 1) // 2 * blocks_in_a_row
    first_blocks = np.full(n_labels, n_blocks, np.int64)
    for p in range(len(places)):
        block = places[p, 0] // 2 * blocks_in_a_row + places[p, 1] // 2
        first_blocks[roots[p]] = min(first_blocks[roots[p]], block)
    roots_at = np.full(n_blocks + 1, -1, np.int32)
    for root in range(n_labels):
        roots_at[first_blocks[root]] = root
    numbers = np.zeros(n_labels, np.int32)
    count = 0
    for root in roots_at[:n_blocks]:
        if root >= 0:
            numbers[root] = count
            count += 1
    return numbers, count
