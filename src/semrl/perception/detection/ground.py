"""What stands still, as things: pieces of the background that are there until something takes them away.

Bricks, walls, platforms and ladders are always in the same place, so the detector of what moves takes them for
background. Here the background is parted into rectangles of one colour. Where the open colour shows, the one that is
commonest, a piece has been taken away; what hides it for a moment has not.
"""

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Image
from semrl.core.kernels import compiled
from semrl.core.things import COLUMNS, GROUND, ID, KIND, LEFT, SLOT, STILL

MOST_PATCHES = 64
"""Of a decision; the smallest are left out."""

_MOST_COLOURS = 15  # besides the open one
_LEAST_SHARE = 0.002  # of the image, that a colour of its own covers
_LEAST_PIXELS = 24  # of a patch
_FIRST_ID = 1_000_000  # tracks have lower ones

Mask = NDArray[np.bool_]


class Ground:
    """The still things of a world, found in its background.

    Parameters
    ----------
    background
        ``(height, width, channels)`` uint8, the commonest colour of each place.
    contrast
        Colours that differ by more than this in some channel are different.

    Examples
    --------
    >>> image = np.zeros((84, 84, 1), np.uint8)
    >>> image[10:20, 40:60] = 200
    >>> ground = Ground(image, 12)
    >>> ground.patches(ground.begin())[:, LEFT:].tolist()
    [[40.0, 10.0, 60.0, 20.0]]
    """

    def __init__(self, background: Frame, contrast: int) -> None:
        self.background = background
        self.contrast = contrast
        colours, of_pixel = _colours(background)
        self._open = colours[0]
        self._materials: NDArray[np.int8] = of_pixel
        self._places = np.flatnonzero(of_pixel.ravel() >= 0).astype(np.int32)
        self._known: tuple[bytes, Floats] = (b"", np.zeros((0, COLUMNS), np.float32))

    def begin(self) -> Mask:
        """Return where the ground is at the beginning of an episode, ``(height, width)``: everywhere."""
        there: Mask = self._materials >= 0
        return there

    def look(self, there: Mask, frame: Frame | Image) -> Mask:
        """Return where the ground is now, given where it was."""
        pixels = np.ascontiguousarray(frame).reshape(-1, self.background.shape[2])
        behind = self.background.reshape(pixels.shape)
        after = there.copy()
        _look(pixels, behind, self._open, self._places, self.contrast, after.reshape(-1))
        return after

    def patches(self, there: Mask) -> Floats:
        """Return the ground as things, ``(n, 9)`` float32 in the order of their identities; of still kinds alone."""
        key = there.tobytes()
        if key != self._known[0]:
            self._known = key, self._parted(there)
        return self._known[1]

    def _parted(self, there: Mask) -> Floats:
        height, width = there.shape
        found = _rectangles(there, self._materials)
        areas = (found[:, 3] - found[:, 1]) * (found[:, 4] - found[:, 2])
        kept = np.argsort(-areas, kind="stable")[:MOST_PATCHES]
        kept = np.sort(kept[areas[kept] >= _LEAST_PIXELS])
        things = np.zeros((len(kept), COLUMNS), np.float32)
        left, top = found[kept, 1], found[kept, 2]
        things[:, ID], things[:, KIND] = _FIRST_ID + top * width + left, found[kept, 0]
        things[:, STILL], things[:, SLOT] = GROUND, -1
        scale = np.array([IMAGE_SIZE_PX / width, IMAGE_SIZE_PX / height] * 2)
        things[:, LEFT:] = found[kept, 1:] * scale
        order = np.argsort(things[:, ID], kind="stable")
        return things[order]


def _colours(background: Frame) -> tuple[Frame, NDArray[np.int8]]:
    """Return the commonest colour, and of each place which of the next ones it has; −1: none of them."""
    pixels = background.reshape(-1, background.shape[2])
    colours, of_pixel, counts = np.unique(pixels, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    listed = [k for k in order[1 : _MOST_COLOURS + 1] if counts[k] >= _LEAST_SHARE * len(pixels)]
    numbers = np.full(len(colours), -1, np.int8)
    numbers[listed] = np.arange(len(listed))
    return colours[order], numbers[of_pixel.ravel()].reshape(background.shape[:2])


@compiled
def _look(  # noqa: PLR0917 - compiled functions take no keywords
    pixels: Frame, behind: Frame, clear: Frame, places: NDArray[np.int32], contrast: int, there: Mask
) -> None:
    """Note where the ground shows, and where what lies open does; elsewhere something hides it."""
    for i in places:
        if _alike(pixels[i], behind[i], contrast):
            there[i] = True
        elif _alike(pixels[i], clear, contrast):
            there[i] = False


@compiled
def _alike(one: Frame, other: Frame, contrast: int) -> bool:
    """Whether two pixels have the same colour."""
    alike = True
    for k in range(len(one)):
        alike = bool(alike & (abs(np.int32(one[k]) - np.int32(other[k])) <= contrast))
    return alike


@compiled
def _rectangles(there: Mask, materials: NDArray[np.int8]) -> NDArray[np.int64]:
    """Part what is there into rectangles, ``(n, 5)``: material, left, top, right, bottom."""
    height, width = there.shape
    found = np.empty((height * width, 5), np.int64)
    growing, above = np.full(width, -1), np.full(width, -1)  # by the column where it begins
    n = 0
    for r in range(height):
        growing[:] = -1
        c = 0
        while c < width:
            if not there[r, c]:
                c += 1
                continue
            begin, material = c, materials[r, c]
            while c < width and there[r, c] and materials[r, c] == material:
                c += 1
            before = above[begin]
            if before >= 0 and found[before, 3] == c and found[before, 0] == material:
                growing[begin] = before
            else:
                found[n, 0], found[n, 1], found[n, 2], found[n, 3] = material, begin, r, c
                growing[begin] = n
                n += 1
            found[growing[begin], 4] = r + 1
        above[:] = growing
    return found[:n]
