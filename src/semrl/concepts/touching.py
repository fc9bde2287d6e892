"""What comes of touching the ground: is what moves stopped, is the ground lost; compiled."""

import numpy as np
from numpy.typing import NDArray

from semrl.concepts.geometry import meeting, time_to_contact
from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.core.things import BOTTOM, GROUND, ID, LEFT, RIGHT, STILL, TOP

LEAST_SPEED_PX = 0.3
"""A decision: what is slower along an axis does not turn there."""

_STEADY_PX = 1.0  # a decision; what turned in the middle of one seems to go slowly on

_LOST_PX2 = 0.5  # of a colour, from which on a piece is gone


@compiled
def count_touches(things: Floats, labels: Ints, ends: Ints, touches: NDArray[np.int64]) -> None:
    """Count in an episode, in place, ``(l, 3)``: touches of each label of the ground, how many of them stopped what
    touched it, and losses after them.

    What moves steadily touches a piece if it reaches it at the next decision when it goes on. It was stopped if two
    decisions later it does not go that way any more, and the piece was lost if there was less of its colour by then.
    """
    struck = np.full(len(touches), -1)
    for t in range(2, len(ends) - 2):
        begin, end = ends[t - 1], ends[t]
        for i in range(begin, end):
            if things[i, STILL] > 0:
                continue
            before = _same(things, things[i, ID], ends[t - 2], begin)
            earlier = _same(things, things[i, ID], ends[t - 3] if t > 2 else 0, ends[t - 2])
            if before < 0 or earlier < 0:
                continue
            vx, vy = _step(things[before], things[i])
            last_vx, last_vy = _step(things[earlier], things[before])
            steady = max(abs(vx - last_vx), abs(vy - last_vy)) <= _STEADY_PX
            if not steady or max(abs(vx), abs(vy)) < LEAST_SPEED_PX:
                continue
            struck[:] = -1
            for j in range(begin, end):
                if things[j, STILL] == GROUND and struck[labels[j]] < 0:
                    struck[labels[j]] = _reached(things[i], things[j], vx, vy)
            for label in range(len(struck)):
                if struck[label] < 0:
                    continue
                lost = _area(things, labels, label, begin, end) - _area(things, labels, label, ends[t + 1], ends[t + 2])
                touches[label, 0] += 1
                touches[label, 1] += _stopped(things, i, (vx, vy), struck[label], ends, t)
                touches[label, 2] += lost > _LOST_PX2


@compiled
def _same(things: Floats, identity: float, begin: int, end: int) -> int:
    """Return the row of a thing among those of a decision; −1 where it is not seen."""
    for j in range(begin, end):
        if things[j, ID] == identity:
            return j
    return -1


@compiled
def _step(one: Floats, after: Floats) -> tuple[float, float]:
    """Return how far the middle of a thing went."""
    across = (after[LEFT] + after[RIGHT] - one[LEFT] - one[RIGHT]) / 2
    return across, (after[TOP] + after[BOTTOM] - one[TOP] - one[BOTTOM]) / 2


@compiled
def _reached(one: Floats, other: Floats, vx: float, vy: float) -> int:
    """Return along which axis a thing will touch another one at the next decision, or on the way; −1: it will not."""
    dx = (other[LEFT] + other[RIGHT] - one[LEFT] - one[RIGHT]) / 2
    dy = (other[TOP] + other[BOTTOM] - one[TOP] - one[BOTTOM]) / 2
    x = (other[RIGHT] - other[LEFT] + one[RIGHT] - one[LEFT]) / 2
    y = (other[BOTTOM] - other[TOP] + one[BOTTOM] - one[TOP]) / 2
    if not 0 < time_to_contact(dx, dy, -vx, -vy, x, y) <= 1:
        return -1
    return 0 if meeting(dx, -vx, x) > meeting(dy, -vy, y) else 1


@compiled
def _stopped(  # noqa: PLR0917 - compiled functions take no keywords
    things: Floats, i: int, velocity: tuple[float, float], axis: int, ends: Ints, t: int
) -> bool:
    """Whether a thing that is still seen does not go on along an axis two decisions later."""
    one = _same(things, things[i, ID], ends[t], ends[t + 1])
    two = _same(things, things[i, ID], ends[t + 1], ends[t + 2])
    if one < 0 or two < 0:
        return False
    return bool(np.sign(velocity[axis]) * _step(things[one], things[two])[axis] < LEAST_SPEED_PX)


@compiled
def _area(things: Floats, labels: Ints, label: int, begin: int, end: int) -> float:
    """Return how much of a colour of the ground there is."""
    area = 0.0
    for j in range(begin, end):
        if labels[j] == label:
            area += (things[j, RIGHT] - things[j, LEFT]) * (things[j, BOTTOM] - things[j, TOP])
    return area
