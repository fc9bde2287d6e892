"""Relations between the things of a scene, from the standard vocabularies, on their boxes; compiled.

*Touches* and *overlaps* are from the region connection calculus, *left of* and *above* from Allen's intervals along an
axis, *approaches* from the qualitative trajectory calculus. Contact is swept: what flies through another thing between
two decisions touches it on the way.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.concepts.geometry import gap, time_to_contact
from semrl.core import Floats, Scene
from semrl.core.kernels import compiled

TOUCH_PX = 0.5
"""Boxes with no wider gap between them touch."""

Pairs = NDArray[np.bool_]

NAMES = ("touches", "overlaps", "left_of", "above", "approaches")
"""Of the relations that hold or do not."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Relations:
    """How each of n things (rows) lies to each other one (columns); nothing relates to itself."""

    touches: Pairs
    """``(n, n)``: the boxes have at most `TOUCH_PX` between them."""
    overlaps: Pairs
    """``(n, n)``: they have an area in common."""
    left_of: Pairs
    above: Pairs
    """``(n, n)``: the one ends where the other begins, or before."""
    approaches: Pairs
    """``(n, n)``: if both go on as they do, they are closer at the next decision."""
    gaps_px: Floats
    """``(n, n, 2)`` float32, between the boxes along x and y; below 0 where they overlap along that axis."""
    decisions_to_contact: Floats
    """``(n, n)`` float32, until the boxes touch if both go on; 0 where they do, infinite where they never will."""


def relations_of(scene: Scene) -> Relations:
    """Return how the things of a scene lie to each other.

    Examples
    --------
    >>> import numpy as np
    >>> from semrl.core import Scene
    >>> numbers = np.arange(2)
    >>> ball_and_wall = Scene(ids=numbers, concepts=numbers, kinds=numbers,
    ...     boxes_px=np.array([[0, 4, 2, 6], [10, 0, 12, 20]], np.float32),
    ...     velocities_px=np.array([[4, 0], [0, 0]], np.float32))
    >>> relations = relations_of(ball_and_wall)
    >>> bool(relations.left_of[0, 1]), bool(relations.approaches[0, 1]), float(relations.decisions_to_contact[0, 1])
    (True, True, 2.0)
    """
    flags, gaps, times = _relate(scene.boxes_px, scene.velocities_px)
    return Relations(**dict(zip(NAMES, flags, strict=True)), gaps_px=gaps, decisions_to_contact=times)


@compiled
def touching(box: Floats, other: Floats) -> bool:
    """Whether two boxes touch."""
    across = max(other[0] - box[2], box[0] - other[2])
    return bool(across <= TOUCH_PX and max(other[1] - box[3], box[1] - other[3]) <= TOUCH_PX)


@compiled
def swept(box: Floats, velocity: Floats, other: Floats, its: Floats) -> float:
    """Return in how many decisions two boxes touch if both go on, at least 99 if never."""
    dx, dy = (other[0] + other[2] - box[0] - box[2]) / 2, (other[1] + other[3] - box[1] - box[3]) / 2
    x, y = (other[2] - other[0] + box[2] - box[0]) / 2, (other[3] - other[1] + box[3] - box[1]) / 2
    return time_to_contact(dx, dy, its[0] - velocity[0], its[1] - velocity[1], x, y)


@compiled
def _relate(boxes: Floats, velocities: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
    n = len(boxes)
    flags, gaps = np.zeros((5, n, n), np.bool_), np.zeros((n, n, 2), np.float32)
    times = np.full((n, n), np.inf, np.float32)
    for i in range(n):
        for j in range(n):
            if i == j:
                times[i, j] = 0
                continue
            now, after = -np.inf, -np.inf
            for axis in range(2):
                middle = (boxes[j, axis] + boxes[j, axis + 2] - boxes[i, axis] - boxes[i, axis + 2]) / 2
                reach = (boxes[j, axis + 2] - boxes[j, axis] + boxes[i, axis + 2] - boxes[i, axis]) / 2
                gaps[i, j, axis] = gap(middle, reach)
                now = max(now, gaps[i, j, axis])
                after = max(after, gap(middle + velocities[j, axis] - velocities[i, axis], reach))
            flags[0, i, j] = now <= TOUCH_PX
            flags[1, i, j] = now < 0
            flags[2, i, j], flags[3, i, j] = boxes[i, 2] <= boxes[j, 0], boxes[i, 3] <= boxes[j, 1]
            flags[4, i, j] = max(after, 0.0) < max(now, 0.0)
            soon = swept(boxes[i], velocities[i], boxes[j], velocities[j])
            if soon < 99:
                times[i, j] = soon
    return flags, gaps, times
