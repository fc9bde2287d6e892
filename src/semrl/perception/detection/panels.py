"""Displays: what changes in its place, and whose outline does not go with it, is background whatever it shows."""

import zlib

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from semrl.core import Frame, Ints
from semrl.core.arrays import Arrays
from semrl.core.protocols import Saved

LARGEST_SHARE = 0.06
"""Of the frame, for the box of a display."""

LEAST_PLAIN_SHARE = 0.8
"""Of what is around a display, in one colour."""

LEAST_FULL_SHARE = 0.8
"""Share of the frames, of those in which it shows anything, in which what it shows must reach three of its edges."""

LEAST_SHOWN_SHARE = 0.25
"""Share of the frames in which it must show anything: what is shot from one place passes others in between."""

LEAST_CONTENTS = 3
"""Different things that it must show: a lamp or a door has two states, of which one is dark or open."""

MOST_CROSSED_SHARE = 0.1
"""Share of the frames in which something may be beside it that is not background."""

_EDGES, _SLACK_PX, _NEAR_PX, _RING_PX = 3, 1, 1, 2


class Panels(Saved):
    """Finds displays: digits of a score or clock, bars that grow and shrink.

    What moves is in turn in one part of the places that it sweeps and in another. What a display shows reaches from top
    to bottom of it nearly always, and from one side at least, a bar like a digit; and nothing comes in or out.

    Attributes
    ----------
    boxes_ : ndarray
        ``(n, 4)`` int64, of what may be displays: first row and column, last row and column, exclusive.
    """

    SAVED = ("boxes_", "_grounds", "_changed", "_counts", "_contents", "_frames")

    def __init__(self) -> None:
        self.boxes_: Ints = np.zeros((0, 4), np.int64)
        self._grounds: Frame = np.zeros((0, 0), np.uint8)  # (n, channels), what is behind each
        self._changed: NDArray[np.bool_] = np.zeros((0, 0), np.bool_)
        self._counts: Ints = np.zeros((0, 3), np.int64)  # (n, 3) frames in which it shows anything, is full, is crossed
        self._contents: Ints = np.full((0, LEAST_CONTENTS), -1, np.int64)  # checksums of the first that each showed
        self._frames = 0

    @property
    def displays_(self) -> Ints:
        """Those of the boxes that are displays, ``(k, 4)``."""
        shows, full, crossed = self._counts.T
        kept = (shows > LEAST_SHOWN_SHARE * self._frames) & (full >= LEAST_FULL_SHARE * shows)
        kept &= self._contents[:, -1] >= 0
        kept &= crossed <= MOST_CROSSED_SHARE * self._frames
        return np.asarray(self.boxes_[kept])

    def propose(self, changed: NDArray[np.bool_], background: Frame) -> None:
        """Take what has changed, ``(height, width)``, in pieces that are small enough, for what may be displays."""
        boxes, grounds = [], []
        for top, left, bottom, right in _pieces(changed):
            around = _beside(background, (top, left, bottom, right))
            colours, counts = np.unique(around, axis=0, return_counts=True)
            if counts.max() < LEAST_PLAIN_SHARE * counts.sum():
                continue
            boxes.append((top, left, bottom, right))
            grounds.append(colours[counts.argmax()])
        self.boxes_ = np.array(boxes, np.int64).reshape(-1, 4)
        self._grounds = np.array(grounds, np.uint8).reshape(-1, background.shape[2])
        self._changed, self._counts, self._frames = changed.copy(), np.zeros((len(boxes), 3), np.int64), 0
        self._contents = np.full((len(boxes), LEAST_CONTENTS), -1, np.int64)

    def check(self, frame: Frame, background: Frame) -> None:
        """See how far what each shows reaches in one more frame, and whether anything comes in or out."""
        self._frames += 1
        for number, box in enumerate(self.boxes_.tolist()):
            top, left, bottom, right = box
            shown = (frame[top:bottom, left:right] != self._grounds[number]).any(axis=2)
            shown &= self._changed[top:bottom, left:right]
            if shown.any():
                edges = [side for axis in (1, 0) for side in _reach(shown.any(axis=axis))]
                lit = frame[top:bottom, left:right][self._changed[top:bottom, left:right]]
                content, known = zlib.crc32(lit.tobytes()), self._contents[number]
                if content not in known and (known < 0).any():
                    known[(known < 0).argmax()] = content
                self._counts[number, :2] += 1, sum(away <= _SLACK_PX for away in edges) >= _EDGES
            crossed = (_beside(frame, box) != _beside(background, box)).any()
            self._counts[number, 2] += crossed

    def calmed(self, frame: Frame, background: Frame) -> Frame:
        """Return the frame with the background in place of displays."""
        displays = self.displays_
        if not len(displays):
            return frame
        calm = frame.copy()
        for top, left, bottom, right in displays.tolist():
            calm[top:bottom, left:right] = background[top:bottom, left:right]
        return calm

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this know of no displays."""
        if arrays:
            super().from_arrays(arrays)


def _pieces(changed: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Return the boxes of pieces of what changed that are small enough.

    Larger ones are cut where nothing changed in whole rows or columns (Nagy & Seth, "Hierarchical representation of
    optically scanned documents", 1984).
    """
    near, _ = ndimage.label(ndimage.binary_dilation(changed, np.ones((3, 3)), iterations=_NEAR_PX))
    near = np.where(changed, near, 0)
    boxes = []
    for number, (rows, columns) in enumerate(ndimage.find_objects(near), 1):
        waiting = [(rows.start, columns.start, near[rows, columns] == number)]
        while waiting:
            top, left, part = waiting.pop()
            if part.size <= LARGEST_SHARE * changed.size:
                boxes.append((top, left, top + part.shape[0], left + part.shape[1]))
                continue
            (y, high), (x, wide) = (_widest_gap(part.any(axis=axis)) for axis in (1, 0))
            if high and high >= wide:
                halves = [(top, left, part[:y]), (top + y + high, left, part[y + high :])]
            elif wide:
                halves = [(top, left, part[:, :x]), (top, left + x + wide, part[:, x + wide :])]
            else:
                continue
            waiting += [_trimmed(*half) for half in halves]
    return boxes


def _trimmed(top: int, left: int, part: NDArray[np.bool_]) -> tuple[int, int, NDArray[np.bool_]]:
    """Return a piece and where it begins without empty rows and columns around it."""
    rows, columns = (np.flatnonzero(part.any(axis=axis)) for axis in (1, 0))
    inner = part[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return top + int(rows[0]), left + int(columns[0]), inner


def _widest_gap(lit: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the widest gap between lit places begins, and how wide it is; 0 where there is none."""
    places = np.flatnonzero(lit)
    gaps = np.diff(places) - 1
    if not gaps.any():
        return 0, 0
    return int(places[gaps.argmax()]) + 1, int(gaps.max())


def _beside(frame: Frame, box: tuple[int, int, int, int]) -> Frame:
    """Return the pixels around a box, ``(p, channels)``."""
    top, left, bottom, right = box
    above, before = max(top - _RING_PX, 0), max(left - _RING_PX, 0)
    part = frame[above : bottom + _RING_PX, before : right + _RING_PX]
    around = np.ones(part.shape[:2], np.bool_)
    around[top - above : bottom - above, left - before : right - before] = False
    return part[around]


def _reach(lit: NDArray[np.bool_]) -> tuple[int, int]:
    """Return how far from either end the first lit place is."""
    places = np.flatnonzero(lit)
    return int(places[0]), int(len(lit) - 1 - places[-1])
