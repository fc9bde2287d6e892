"""From a raw RGB frame to the small grey image that everything after it works on (§3.2.1)."""

import cv2
import numpy as np

from semrl.errors import DataError
from semrl.types import IMAGE_SIZE_PX, Frame, Image


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
    small = cv2.resize(frame, (IMAGE_SIZE_PX, IMAGE_SIZE_PX), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
