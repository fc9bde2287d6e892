"""Arrays that have a name, and what they are measured in."""

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
"""An RGB image, ``(height, width, 3)``."""

IMAGE_SIZE_PX = 84
"""Edge of the preprocessed image (§3.2.1)."""

Image = NDArray[np.uint8]
"""A preprocessed grey or labelled image, ``(84, 84)``."""

Floats = NDArray[np.float32]
Ints = NDArray[np.int64]

NO_ACTION = -1
"""Stands where there was no action yet."""
