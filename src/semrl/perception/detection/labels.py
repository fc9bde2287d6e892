"""Labelled images: what the agents `otsu` and `birch` see instead of grey ones (§4.3)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Image

# Bright and far apart, so that a network tells labels from each other and all of them from the background.
_GREYS = np.arange(255, 54, -20, dtype=np.uint8)


def label_image(labels: NDArray[np.integer[Any]]) -> Image:
    """Give every label its own grey level.

    Parameters
    ----------
    labels
        ``(84, 84)`` integers; 0 is background. Labels 1 … 11 get levels 255, 235, … 55; higher ones share them.

    Returns
    -------
    ``(84, 84)`` uint8, background 0.
    """
    return np.where(labels > 0, _GREYS[(labels - 1) % len(_GREYS)], np.uint8(0))
