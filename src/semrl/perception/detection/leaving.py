"""What stays in one place most of the time, and leaves it and comes back, is no background."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from semrl.core import Frame

LEAST_SWITCHES = 6
"""How often the colour that a place has mostly, and the one behind it, must come or go: what is lost once, like a
brick, and is there again in the next episode, does so less often."""

LEAST_SHARE = 0.04
"""Share of the frames in which the colour behind must be seen."""

_RING_PX = 2


def without_leaving(
    background: Frame, shown: Frame, times: NDArray[np.int32], switches: NDArray[np.int32], frames: int
) -> Frame:
    """Return the background with what is behind in place of things that leave and come back.

    What is behind a thing has the colour of the ground around it.

    Parameters
    ----------
    background
        ``(height, width, channels)``, the commonest colours.
    shown
        ``(p, k, channels)``, colours seen at each place.
    times, switches
        ``(p, k)``, frames in which each was there, and how often it came or went.
    frames
        That were looked at.
    """
    height, width, channels = background.shape
    mostly = (shown == background.reshape(-1, 1, channels)).all(axis=2)
    often = switches >= LEAST_SWITCHES
    behind = often & ~mostly & (times >= LEAST_SHARE * frames)
    leaves = ((often & mostly).any(axis=1) & behind.any(axis=1)).reshape(height, width)
    things, _ = ndimage.label(leaves, np.ones((3, 3)))
    repaired = background.copy()
    for number, (rows, columns) in enumerate(ndimage.find_objects(things), 1):
        above, before = max(rows.start - _RING_PX, 0), max(columns.start - _RING_PX, 0)
        window = slice(above, rows.stop + _RING_PX), slice(before, columns.stop + _RING_PX)
        thing = things[window] == number
        ring = ndimage.binary_dilation(thing, np.ones((3, 3)), iterations=_RING_PX) & ~leaves[window]
        if not ring.any():
            continue
        colours, counts = np.unique(background[window][ring], axis=0, return_counts=True)
        ground = colours[counts.argmax()]
        places = np.arange(height * width).reshape(height, width)[window][thing]
        uncovered = places[(behind[places] & (shown[places] == ground).all(axis=2)).any(axis=1)]
        repaired.reshape(-1, channels)[uncovered] = ground
    return repaired
