"""Flashes: for a moment the ground has another colour everywhere, and is ground still."""

import numpy as np

from semrl.core import Frame, Ints
from semrl.core.kernels import compiled

LEAST_SHARE = 0.6
"""Of the sampled places of the ground, in one other colour."""

_SAMPLES = 64
_STEP = 3  # of the rows and columns in which the commonest colour is looked for


class Flashes:
    """Knows the commonest colour of a background, and undoes what covers it in one other colour.

    Parameters
    ----------
    background
        ``(height, width, channels)``, the commonest colours.

    Attributes
    ----------
    ground : ndarray
        ``(1, channels)``, the commonest of them.
    """

    def __init__(self, background: Frame) -> None:
        sampled = background[::_STEP, ::_STEP].reshape(-1, background.shape[2])
        codes = sampled @ 256 ** np.arange(sampled.shape[1], dtype=np.int64)
        _, first, counts = np.unique(codes, return_index=True, return_counts=True)
        self.ground: Frame = sampled[[first[counts.argmax()]]]
        places = np.flatnonzero((background == self.ground).all(axis=2))
        self._places: Ints = places[:: max(len(places) // _SAMPLES, 1)]
        self._background = background

    def calmed(self, frame: Frame) -> Frame:
        """Return the frame with the ground in its own colour."""
        shown = _commonest(frame.reshape(-1, frame.shape[2]), self._places, self.ground[0])
        if shown < 0:
            return frame
        colour = frame.reshape(-1, frame.shape[2])[shown]
        calm = frame.copy()
        calm[(frame == colour).all(axis=2) & (self._background == self.ground).all(axis=2)] = self.ground
        return calm


@compiled
def _commonest(pixels: Frame, places: Ints, ground: Frame) -> int:
    """Return a place at which the colour shows that most of the places have in place of the ground; −1: none does."""
    candidate, votes = -1, 0
    for i in places:
        if candidate >= 0 and _same(pixels[i], pixels[candidate]):
            votes += 1
        elif votes == 0:
            candidate, votes = i, 1
        else:
            votes -= 1
    if candidate < 0 or _same(pixels[candidate], ground):
        return -1
    count = 0
    for i in places:
        count += _same(pixels[i], pixels[candidate])
    return candidate if count >= LEAST_SHARE * len(places) else -1


@compiled
def _same(one: Frame, other: Frame) -> bool:
    """Whether two pixels have exactly the same colour."""
    same = True
    for k in range(len(one)):
        same &= bool(one[k] == other[k])
    return same
