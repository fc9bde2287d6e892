"""The compiled half of the foreground detector: the loops over pixels."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Frame, Ints
from semrl.core.kernels import compiled

Places = NDArray[np.int32]
"""``(p,)``: row × width + column of pixels, those of one object behind each other."""


@compiled
def vote(frame: Frame, background: Frame, votes: NDArray[np.int32]) -> None:
    """Let one frame vote on the background, in place."""
    height, width, channels = frame.shape
    for r in range(height):
        for c in range(width):
            same = True
            for k in range(channels):
                same &= frame[r, c, k] == background[r, c, k]
            if same:
                votes[r, c] += 1
            elif votes[r, c] == 0:
                background[r, c] = frame[r, c]
                votes[r, c] = 1
            else:
                votes[r, c] -= 1


@compiled
def _differ(a: Frame, i: int, b: Frame, j: int, contrast: int) -> bool:
    """Whether pixel ``i`` of one frame and ``j`` of another, both ``(p, channels)``, have different colours."""
    differ = False
    for k in range(a.shape[1]):
        if abs(np.int32(a[i, k]) - np.int32(b[j, k])) > contrast:
            differ = True
    return differ


@compiled
def _foreground(pixels: Frame, behind: Frame, contrast: int) -> Places:
    """Return where two frames, ``(p, channels)``, differ; most of it is alike and passed over in steps of 8 bytes."""
    n, channels = pixels.shape
    words = n * channels // 8
    ours, theirs = pixels.reshape(-1)[: words * 8].view(np.int64), behind.reshape(-1)[: words * 8].view(np.int64)
    found, places = 0, np.empty(n, np.int32)
    first = 0  # the first pixel that was not looked at yet
    for word in range(words + 1):
        if word < words and ours[word] == theirs[word]:
            continue
        end = (word * 8 + 7) // channels + 1 if word < words else n
        for i in range(max(first, word * 8 // channels), end):
            if _differ(pixels, i, behind, i, contrast):
                places[found] = i
                found += 1
        first = end
    return places[:found]


@compiled
def find_components(frame: Frame, background: Frame, contrast: int) -> tuple[Places, Ints]:
    """Find connected pixels (8 neighbours) of one colour that differ from the background.

    Returns
    -------
    places
        ``(p,)``, see `Places`.
    ends
        ``(n,)`` int64: where in it each object ends.
    """
    height, width, channels = frame.shape
    pixels = frame.reshape(height * width, channels)
    foreground = _foreground(pixels, background.reshape(height * width, channels), contrast)
    waiting = np.zeros(height * width, np.bool_)
    for i in foreground:
        waiting[i] = True
    places, ends = np.empty(len(foreground), np.int32), np.empty(len(foreground), np.int64)
    found, objects = 0, 0
    for i in foreground:
        if not waiting[i]:
            continue
        waiting[i] = False
        places[found] = i
        looked, found = found, found + 1
        while looked < found:  # the pixels found so far are their own queue
            here = places[looked]
            looked += 1
            r, c = here // width, here % width
            for y in range(max(r - 1, 0), min(r + 2, height)):
                for x in range(max(c - 1, 0), min(c + 2, width)):
                    there = y * width + x
                    if waiting[there] and not _differ(pixels, there, pixels, here, contrast):
                        waiting[there] = False
                        places[found] = there
                        found += 1
        ends[objects] = found
        objects += 1
    return places, ends[:objects]


HOLE_SHARE, GROUND_HOLE_SHARE = 0.5, 0.1
"""Share of a piece's outline that must not be seen, for it to be ground where something of the background is gone; the
second for pieces in the commonest colour of the background."""


@compiled
def without_holes(  # noqa: PLR0917 - compiled functions take no keywords
    frame: Frame, background: Frame, ground: Frame, places: Places, ends: Ints, contrast: int
) -> tuple[Places, Ints]:
    """Leave out pieces that are as coloured as the background beside them, see `find_components`.

    The commonest colour of the background is that of ``ground``, ``(1, channels)``.
    """
    height, width, channels = frame.shape
    pixels, behind = frame.reshape(height * width, channels), background.reshape(height * width, channels)
    kept, kept_ends = np.empty_like(places), np.empty_like(ends)
    filled, objects, start = 0, 0, 0
    for end in ends:
        outline, unseen, most = 0, 0, HOLE_SHARE
        if not _differ(pixels, places[start], ground, 0, contrast):
            most = GROUND_HOLE_SHARE
        for here in places[start:end]:
            r, c = here // width, here % width
            for y, x in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                if 0 <= y < height and 0 <= x < width:
                    there = y * width + x
                    if _differ(pixels, there, pixels, here, contrast):
                        outline += 1
                    elif not _differ(pixels, there, behind, there, contrast):
                        outline += 1
                        unseen += 1
        if unseen <= most * outline:
            for here in places[start:end]:
                kept[filled] = here
                filled += 1
            kept_ends[objects] = filled
            objects += 1
        start = end
    return kept[:filled], kept_ends[:objects]


@compiled
def draw_objects(  # noqa: PLR0917 - compiled functions take no keywords
    frame: Frame, places: Places, starts: Ints, ends: Ints, window_px: int, side_px: int
) -> tuple[Floats, Floats, Ints, NDArray[np.int32], Floats, Floats]:
    """Measure and draw objects in units of a small image of `side_px` pixels a side; see `Objects`."""
    height, width, channels = frame.shape
    n = len(starts)
    scale = np.array([side_px / height, side_px / width])
    crops = np.zeros((n, window_px, window_px), np.float32)
    centres = np.zeros((n, 2), np.float32)
    boxes = np.zeros((n, 4), np.int64)
    labels = np.zeros((side_px, side_px), np.int32)
    edges = np.zeros((n, 4), np.float32)
    colours = np.zeros((n, 3), np.float32)
    for i in range(n):
        low, high, total = np.array([height, width]), np.array([-1, -1]), np.zeros(2)
        shade = np.zeros(3)
        for place in places[starts[i] : ends[i]]:
            r, c = place // width, place % width
            low[0], low[1] = min(low[0], r), min(low[1], c)
            high[0], high[1] = max(high[0], r + 1), max(high[1], c + 1)
            total[0] += r
            total[1] += c
            for k in range(3):
                shade[k] += frame[r, c, min(k, channels - 1)]
            labels[int((r + 0.5) * scale[0]), int((c + 0.5) * scale[1])] = i + 1
        colours[i] = shade / (ends[i] - starts[i])
        for axis in range(2):
            centres[i, axis] = (total[axis] / (ends[i] - starts[i]) + 0.5) * scale[axis] - 0.5
            edges[i, 1 - axis], edges[i, 3 - axis] = low[axis] * scale[axis], high[axis] * scale[axis]
            boxes[i, axis] = int(low[axis] * scale[axis])
            boxes[i, axis + 2] = int(np.ceil(high[axis] * scale[axis])) - boxes[i, axis]
        _draw(frame, places[starts[i] : ends[i]], (low + high) / 2, high - low, scale, crops[i])
    return crops, centres, boxes, labels, edges, colours


@compiled
def _draw(  # noqa: PLR0917
    frame: Frame,
    places: Places,
    middle: NDArray[np.float64],
    size: Ints,
    scale: NDArray[np.float64],
    crop: Floats,
) -> None:
    """Add an object's pixels to its crop, each to the cells that it covers, in proportion."""
    width, channels, window = frame.shape[1], frame.shape[2], len(crop)
    step = scale * min(1.0, window / max(size[0] * scale[0], size[1] * scale[1]))
    for place in places:
        r, c = place // width, place % width
        grey = float(frame[r, c, 0])
        if channels == 3:
            grey = 0.299 * frame[r, c, 0] + 0.587 * frame[r, c, 1] + 0.114 * frame[r, c, 2]
        top, left = (r - middle[0]) * step[0] + window / 2, (c - middle[1]) * step[1] + window / 2
        for y in range(max(int(top), 0), min(int(np.ceil(top + step[0])), window)):
            share = min(top + step[0], y + 1.0) - max(top, float(y))
            for x in range(max(int(left), 0), min(int(np.ceil(left + step[1])), window)):
                cover = share * (min(left + step[1], x + 1.0) - max(left, float(x)))
                crop[y, x] += cover * (1 + grey / 64) / 5
