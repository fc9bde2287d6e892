"""Connected components of what is bright (§3.2.1), compiled."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semrl.types import Image, Ints

compiled = njit(cache=True, nogil=True)


@compiled
def connected_components(image: Image, threshold: float) -> tuple[NDArray[np.int32], Ints]:
    """Number the components (8 neighbours) of the pixels above a threshold.

    They are numbered by the first block of 2×2 pixels that they touch, blocks taken from left to right and from
    top to bottom, which is how OpenCV numbers them: no two components touch the same block.

    Parameters
    ----------
    image
        ``(height, width)`` uint8.
    threshold
        In grey levels; what is above it is foreground.

    Returns
    -------
    labels
        ``(height, width)`` int32, from 1 on; 0 is background.
    boxes_px
        ``(c, 4)`` int64, top, left, height and width of each component.
    """
    labels, parents = _provisional_labels(image, threshold)
    numbers, count = _final_numbers(labels, parents)
    boxes = np.empty((count, 4), np.int64)
    boxes[:, :2], boxes[:, 2:] = max(image.shape), -1
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            if labels[row, column]:
                number = numbers[labels[row, column]]
                labels[row, column] = number
                box = boxes[number - 1]
                box[0], box[1] = min(box[0], row), min(box[1], column)
                box[2], box[3] = max(box[2], row), max(box[3], column)
    boxes[:, 2:] += 1 - boxes[:, :2]
    return labels, boxes


@compiled
def _provisional_labels(image: Image, threshold: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Label each foreground pixel as one of its earlier neighbours, and write down which labels are one."""
    height, width = image.shape
    level = int(np.floor(threshold))  # grey levels are whole
    labels = np.zeros((height, width), np.int32)
    parents = np.zeros(((height + 1) // 2) * ((width + 1) // 2) + 1, np.int32)
    count = 0
    for row in range(height):
        for column in range(width):
            if image[row, column] <= level:
                continue
            label = labels[row, column - 1] if column else 0
            above = labels[row - 1] if row else labels[row]
            for beside in range(max(column - 1, 0), min(column + 2, width) if row else 0):
                other = above[beside]
                if other and other != label:
                    label = _join(parents, other, label) if label else other
            if not label:
                count += 1
                parents[count] = count
                label = count
            labels[row, column] = label
    return labels, parents


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
def _final_numbers(labels: NDArray[np.int32], parents: NDArray[np.int32]) -> tuple[NDArray[np.int32], int]:
    """Return the number of each provisional label's component, by blocks, and how many components there are."""
    height, width = labels.shape
    numbers = np.zeros(len(parents), np.int32)
    count = 0
    for top in range(0, height, 2):
        for left in range(0, width, 2):
            for row in range(top, min(top + 2, height)):
                for column in range(left, min(left + 2, width)):
                    root = _root(parents, labels[row, column])
                    if root and not numbers[root]:
                        count += 1
                        numbers[root] = count
    for label in range(1, len(parents)):
        numbers[label] = numbers[_root(parents, label)]
    return numbers, count
