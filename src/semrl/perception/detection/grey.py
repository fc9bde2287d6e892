"""From a raw RGB frame to the small grey image that everything after it works on (§3.2.1)."""

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Image, Ints
from semrl.core.errors import DataError
from semrl.core.kernels import compiled

_LEAST_OVERLAP_PX = 1e-3
"""What overlaps by less is rounding."""


class Shares(NamedTuple):
    """Which source pixels make each target pixel along one axis, and with which weights, which sum to 1."""

    starts: Ints  # (target + 1,) where the sources of each target pixel begin
    sources: Ints  # (k,)
    weights: Floats  # (k,)


def to_grey(frame: Frame) -> Image:
    """Scale to 84×84 by area interpolation, then turn grey (§3.2.1).

    Parameters
    ----------
    frame
        ``(height, width, 3)`` uint8, RGB.

    Returns
    -------
    ``(84, 84)`` uint8, luma of ITU-R BT.601.

    Raises
    ------
    DataError
        When the frame is no RGB image.
    """
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8 or frame.size == 0:
        raise DataError(f"expected an RGB frame (height, width, 3) of uint8, got {frame.shape} of {frame.dtype}")
    height, width, _ = frame.shape
    if min(height, width) < IMAGE_SIZE_PX or (height % IMAGE_SIZE_PX == 0 and width % IMAGE_SIZE_PX == 0):
        small = cv2.resize(frame, (IMAGE_SIZE_PX, IMAGE_SIZE_PX), interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    lines = np.ascontiguousarray(frame).reshape(height, 3 * width)
    return shrink(lines, shares(height, IMAGE_SIZE_PX), shares(width, IMAGE_SIZE_PX))


def as_grey(frame: Frame | Image) -> Image:
    """Return the small grey image of a frame, or the image itself where that is given.

    Raises
    ------
    DataError
        When it is neither.
    """
    if frame.ndim == 3:
        return to_grey(frame)
    if frame.shape != (IMAGE_SIZE_PX, IMAGE_SIZE_PX) or frame.dtype != np.uint8:
        raise DataError(f"expected an RGB frame or a grey image (84, 84) of uint8, got {frame.shape} of {frame.dtype}")
    return frame


@lru_cache(maxsize=64)
def shares(source: int, target: int) -> Shares:
    """Divide `source` pixels among fewer `target` ones by how much they overlap."""
    scale = source / target
    starts, sources, weights = [0], [], []
    for i in range(target):
        low, high = i * scale, i * scale + scale
        for j in range(int(low), min(int(high) + 1, source)):
            overlap = min(j + 1, high) - max(j, low)
            if overlap > _LEAST_OVERLAP_PX:
                sources.append(j)
                weights.append(overlap / scale)
        starts.append(len(sources))
    return Shares(np.array(starts), np.array(sources), np.array(weights, np.float32))


@compiled
def shrink(lines: NDArray[np.uint8], rows: Shares, columns: Shares) -> Image:
    """Average a frame of ``(height, 3 width)`` over areas and turn it grey, to the bit as OpenCV does.

    The sums are those of ``cv2.INTER_AREA``, in its order and precision. What makes it faster: a line that equals
    the one above it is summed once, and in a game's frame most do.
    """
    small = np.empty((len(rows.starts) - 1, len(columns.starts) - 1), np.uint8)
    sums = np.empty(3 * small.shape[1], np.float32)  # of the line named last
    total = np.empty_like(sums)
    last = -1
    for i in range(len(small)):
        total[:] = 0
        for k in range(rows.starts[i], rows.starts[i + 1]):
            source, weight = rows.sources[k], rows.weights[k]
            if last < 0 or _differ(lines[source], lines[last]):
                _sum_line(lines[source], columns, sums)
            last = source
            for j in range(len(total)):
                total[j] += weight * sums[j]
        _turn_grey(total, small[i])
    return small


@compiled
def _differ(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> bool:
    different = np.uint8(0)
    for i in range(len(a)):
        different = np.uint8(different | np.uint8(a[i] ^ b[i]))  # bytes all along: 32 at a time
    return bool(different)


@compiled
def _sum_line(line: NDArray[np.uint8], columns: Shares, sums: Floats) -> None:
    """Average the colours of a line over the width of each target pixel."""
    for i in range(len(columns.starts) - 1):
        red = green = blue = np.float32(0)
        for k in range(columns.starts[i], columns.starts[i + 1]):
            place, weight = 3 * columns.sources[k], columns.weights[k]
            red += np.float32(line[place]) * weight
            green += np.float32(line[place + 1]) * weight
            blue += np.float32(line[place + 2]) * weight
        sums[3 * i], sums[3 * i + 1], sums[3 * i + 2] = red, green, blue


@compiled
def _turn_grey(colours: Floats, grey: NDArray[np.uint8]) -> None:
    """Round colours, halves to even, and take their luma in 15-bit fixed-point numbers."""
    for i in range(len(grey)):
        red, green, blue = np.rint(colours[3 * i]), np.rint(colours[3 * i + 1]), np.rint(colours[3 * i + 2])
        grey[i] = (9798 * int(red) + 19235 * int(green) + 3735 * int(blue) + (1 << 14)) >> 15
