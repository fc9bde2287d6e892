"""The compiled half of `Parts`: which objects touch."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Frame, Ints
from semrl.core.kernels import compiled
from semrl.perception.detection.foreground_kernels import Places


@compiled
def colours_of(frame: Frame, places: Places, ends: Ints, known: Frame) -> Ints:
    """Return which of the known colours, ``(k, channels)``, each object's first pixel has; −1 for none."""
    width, channels = frame.shape[1], frame.shape[2]
    colours = np.full(len(ends), -1, np.int64)
    start = 0
    for i in range(len(ends)):
        r, c = places[start] // width, places[start] % width
        for k in range(len(known)):
            same = True
            for channel in range(channels):
                same &= frame[r, c, channel] == known[k, channel]
            if same:
                colours[i] = k
                break
        start = ends[i]
    return colours


REACH_PX = 2
"""Pixels touch that are no farther apart, in rows and columns: stripes of one thing may have gaps of one pixel."""


@compiled
def touching(places: Places, ends: Ints, height: int, width: int) -> NDArray[np.bool_]:
    """Return which objects have pixels that touch, ``(n, n)``, symmetric."""
    n = len(ends)
    whose = np.full((height + 2 * REACH_PX, width + 2 * REACH_PX), -1, np.int32)
    start = 0
    for i in range(n):
        for place in places[start : ends[i]]:
            whose[place // width + REACH_PX, place % width + REACH_PX] = i
        start = ends[i]
    touch = np.zeros((n, n), np.bool_)
    start = 0
    for i in range(n):
        for place in places[start : ends[i]]:
            r, c = place // width + REACH_PX, place % width + REACH_PX
            for y in range(r - REACH_PX, r + REACH_PX + 1):
                for x in range(c - REACH_PX, c + REACH_PX + 1):
                    if whose[y, x] > i:
                        touch[i, whose[y, x]] = True
                        touch[whose[y, x], i] = True
        start = ends[i]
    return touch


@compiled
def join(places: Places, ends: Ints, one: NDArray[np.bool_]) -> tuple[Places, Ints]:
    """Make one object of all that hang together by pairs, ``(n, n)``, in the order of their first ones."""
    n = len(ends)
    sizes = ends.copy()
    sizes[1:] -= ends[:-1]
    done, waiting = np.zeros(n, np.bool_), np.empty(n, np.int64)
    joined, joined_ends = np.empty_like(places), np.empty_like(ends)
    filled, objects = 0, 0
    for first in range(n):
        if done[first]:
            continue
        done[first] = True
        waiting[0], looked, found = first, 0, 1
        while looked < found:
            i = waiting[looked]
            looked += 1
            joined[filled : filled + sizes[i]] = places[ends[i] - sizes[i] : ends[i]]
            filled += sizes[i]
            for j in range(n):
                if one[i, j] and not done[j]:
                    done[j] = True
                    waiting[found] = j
                    found += 1
        joined_ends[objects] = filled
        objects += 1
    return joined, joined_ends[:objects]
