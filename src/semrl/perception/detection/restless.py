"""Places that change all the time: water and digits that run are background in each of their colours."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from semrl.core import Frame, Ints
from semrl.core.arrays import Arrays
from semrl.core.kernels import compiled
from semrl.core.protocols import Saved
from semrl.perception.detection.foreground_kernels import Places
from semrl.perception.detection.leaving import without_leaving

LEAST_RATE = 0.15
"""Share of the frames at which a colour must come or go at a place, to be one that the place has by itself."""

LEAST_SHARE = 0.25
"""Share of the frames in which it must be there: what passes, however often, is elsewhere most of the time."""

LEAST_SWITCHES = 10
"""Of such a colour, or it may be chance."""

LEAST_WITHIN = 0.95
"""Share of what touches a region that must lie within it: things leave their places, waves and digits do not."""

MOST_COLOURS = 4
"""Of a place, the first that are seen there, and of a region, the commonest."""

_NEAR_PX = 3  # restless places that are no farther apart are one region, which ends as far beyond the last of them


class Restless(Saved):
    """Finds regions in which some colours come and go all the time.

    Where things pass, or stay for a while, a colour comes and goes once a visit. Waves, and the digits of a clock of
    hundredths, come and go in the same places all the time, and never leave them: that is how these places are, and
    belongs to no thing. What is seen there in another colour is one.

    Attributes
    ----------
    regions_ : ndarray
        ``(r, 4)`` int64: first row and column, last row and column, exclusive.
    colours_ : ndarray
        ``(r, 4, channels)`` uint8, of each region; where there are fewer, the first again.
    """

    SAVED = ("regions_", "colours_", "_within", "_beyond", "_frames", "_shown", "_times", "_switches", "_last")

    _shown: Frame
    _times: NDArray[np.int32]
    _switches: NDArray[np.int32]
    _last: NDArray[np.int8]

    def __init__(self) -> None:
        self._be(np.zeros((0, 4), np.int64), np.zeros((0, MOST_COLOURS, 0), np.uint8))
        self.forget()

    @property
    def is_learning(self) -> bool:
        """Whether frames were counted, and regions not yet found in them."""
        return bool(len(self._last))

    @property
    def changed(self) -> NDArray[np.bool_]:
        """Where more than one colour was seen in the frames counted, ``(p,)``."""
        return np.asarray(self._times[:, 1] > 0)

    def without_leaving(self, background: Frame) -> Frame:
        """Return the background without what leaves its place and comes back, but for what does so all the time."""
        calm = np.where(self._often.any(axis=1, keepdims=True), 0, self._switches)
        return without_leaving(background, self._shown, self._times, calm, self._frames)

    @property
    def _often(self) -> NDArray[np.bool_]:
        """Which colours come and go all the time, ``(p, 4)``."""
        often = self._switches >= max(LEAST_RATE * self._frames, LEAST_SWITCHES)
        return np.asarray(often & (self._times >= LEAST_SHARE * self._frames))

    def learn(self, frame: Frame) -> None:
        """Count one frame, ``(height, width, channels)``; they are expected in their order."""
        pixels = frame.reshape(-1, frame.shape[2])
        self._frames += 1
        if not len(self._last):
            self._shown = np.zeros((len(pixels), MOST_COLOURS, pixels.shape[1]), np.uint8)
            self._times, self._switches = (np.zeros((len(pixels), MOST_COLOURS), np.int32) for _ in range(2))
            self._last = np.full(len(pixels), -1, np.int8)
        _count(pixels, self._shown, self._times, self._switches, self._last)

    def settle(self, background: Frame) -> None:
        """Find the regions."""
        often = self._often
        often &= (self._shown != background.reshape(len(often), 1, -1)).any(axis=2)
        height, width, channels = background.shape
        restless = often.any(axis=1).reshape(height, width)
        near, _ = ndimage.label(ndimage.binary_dilation(restless, np.ones((3, 3)), iterations=_NEAR_PX))
        regions, colours = [], []
        for rows, columns in ndimage.find_objects(near):
            inside = np.zeros_like(restless)
            inside[rows, columns] = True
            own, counts = np.unique(self._shown[often & inside.reshape(-1, 1)], axis=0, return_counts=True)
            own = own[np.argsort(-counts, kind="stable")[:MOST_COLOURS]]
            regions.append([rows.start, columns.start, rows.stop, columns.stop])
            colours.append(np.concatenate([own, np.repeat(own[:1], MOST_COLOURS - len(own), axis=0)]))
        shape = (len(regions), MOST_COLOURS, channels)
        self._be(np.array(regions, np.int64).reshape(-1, 4), np.array(colours, np.uint8).reshape(shape))

    def check(self, places: Places, ends: Ints, width: int) -> None:
        """See whether what is found in the regions stays there: pieces, as `find_components` returns them."""
        if not len(self.regions_):
            return
        rows, columns = places // width, places % width
        sizes = np.diff(ends, prepend=0)
        begins = ends - sizes
        for number, (top, left, bottom, right) in enumerate(self.regions_.tolist()):
            inside = (rows >= top) & (rows < bottom) & (columns >= left) & (columns < right)
            counts = np.add.reduceat(inside, begins, dtype=np.int64) if len(ends) else sizes
            self._within[number] += counts.sum()
            self._beyond[number] += (sizes - counts)[counts > 0].sum()

    def calmed(self, frame: Frame, background: Frame) -> Frame:
        """Return the frame with the background where a region has one of its colours."""
        kept = np.flatnonzero(self._within * (1 - LEAST_WITHIN) > self._beyond * LEAST_WITHIN)
        if not len(kept):
            return frame
        calm = frame.copy()
        for number in kept:
            top, left, bottom, right = self.regions_[number]
            shown, behind = calm[top:bottom, left:right], background[top:bottom, left:right]
            own = (shown[:, :, None] == self.colours_[number]).all(axis=3).any(axis=2)
            shown[own] = behind[own]
        return calm

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know of no restless places."""
        if arrays:
            super().from_arrays(arrays)

    def _be(self, regions: Ints, colours: Frame) -> None:
        self.regions_, self.colours_ = regions, colours
        self._within, self._beyond = (np.zeros(len(regions), np.int64) for _ in range(2))  # pixels of what touches each

    def forget(self) -> None:
        """Forget what was counted."""
        self._frames = 0
        self._shown = np.zeros((0, MOST_COLOURS, 0), np.uint8)  # (p, 4, channels)
        self._times = np.zeros((0, MOST_COLOURS), np.int32)  # frames in which each was there
        self._switches = np.zeros((0, MOST_COLOURS), np.int32)  # how often it came or went
        self._last = np.zeros(0, np.int8)  # which of them each place had, -1: another


@compiled
def _count(
    pixels: Frame, shown: Frame, times: NDArray[np.int32], switches: NDArray[np.int32], last: NDArray[np.int8]
) -> None:
    """Note the colour of each place, and that it came and another went, in place."""
    for i in range(len(pixels)):
        now = -1
        for k in range(switches.shape[1]):
            if times[i, k] == 0:
                shown[i, k] = pixels[i]
            same = True
            for channel in range(pixels.shape[1]):
                same &= bool(pixels[i, channel] == shown[i, k, channel])
            if same:
                now = k
                times[i, k] += 1
                break
        if now != last[i]:
            if now >= 0:
                switches[i, now] += 1
            if last[i] >= 0:
                switches[i, last[i]] += 1
            last[i] = now
