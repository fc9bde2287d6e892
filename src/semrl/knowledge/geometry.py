"""Roles between the things of a scene and the borders of its arena, as their boxes and velocities have them.

Left, right, above and below are of the projected centres; touching is RCC8's external connection, within a tolerance;
approaching is the "−" of the basic qualitative trajectory calculus, of the first thing alone.
"""

import numpy as np
from numpy.typing import NDArray

from semrl.core.kernels import compiled
from semrl.knowledge.ontology import Role

BORDERS = ("left_border", "top_border", "right_border", "bottom_border")
"""Individuals that are in every scene."""

TOUCHING_PERCENT = 2.0
"""Gap up to which two boxes touch: less than two pixels of the 84×84 image."""

NEAR_PERCENT = 15.0
"""Gap up to which two boxes are near each other."""

ROLES = (
    Role(name="leftOf", inverse="rightOf", transitive=True, comment="Its centre lies further left."),
    Role(name="rightOf", inverse="leftOf", transitive=True, comment="Its centre lies further right."),
    Role(name="above", inverse="below", transitive=True, comment="Its centre lies higher."),
    Role(name="below", inverse="above", transitive=True, comment="Its centre lies lower."),
    Role(name="level", symmetric=True, comment="Their boxes share a row of the image."),
    Role(
        name="touches", symmetric=True, comment=f"The gap between them is {TOUCHING_PERCENT:g} % of the image at most."
    ),
    Role(name="near", symmetric=True, comment=f"The gap between them is {NEAR_PERCENT:g} % of the image at most."),
    Role(name="approaches", comment="It moves towards the other one's place."),
)
"""In the order in which `relate` writes them, behind `contains`."""

_LEFT, _RIGHT, _ABOVE, _BELOW, _LEVEL, _TOUCHES, _NEAR, _APPROACHES = range(1, 9)
_N_BORDERS = len(BORDERS)
_LEFT_BORDER, _TOP, _RIGHT_BORDER, _BOTTOM = range(1, 5)


@compiled
def relate(  # noqa: PLR0917 - compiled functions take no keywords
    centres: NDArray[np.float64],
    velocities: NDArray[np.float64],
    sizes: NDArray[np.float64],
    present: NDArray[np.bool_],
    arena: NDArray[np.float64],
    roles: NDArray[np.bool_],
) -> None:
    """Write the roles of ``b`` scenes of ``k`` things.

    Parameters
    ----------
    centres, velocities
        ``(b, k, 2)``, x and y, in percent of the image, and of these a decision.
    sizes
        ``(k, 2)``, width and height.
    present
        ``(b, k)``.
    arena
        ``(4,)``, left, top, right, bottom of where things move.
    roles
        ``(b, r, n, n)``, all False; n is the scene, four borders, the things.
    """
    scenes, things, _ = centres.shape
    for s in range(scenes):
        for a in range(things):
            if not present[s, a]:
                continue
            i = 1 + _N_BORDERS + a
            roles[s, 0, 0, i] = True
            x, y = centres[s, a]
            vx, vy = velocities[s, a]
            half_x, half_y = sizes[a, 0] / 2, sizes[a, 1] / 2
            gaps = (x - half_x - arena[0], y - half_y - arena[1], arena[2] - x - half_x, arena[3] - y - half_y)
            going = (-vx, -vy, vx, vy)
            for border in range(_N_BORDERS):
                roles[s, _APPROACHES, i, 1 + border] = going[border] > 0
                if gaps[border] <= TOUCHING_PERCENT:
                    roles[s, _TOUCHES, i, 1 + border] = roles[s, _TOUCHES, 1 + border, i] = True
                if gaps[border] <= NEAR_PERCENT:
                    roles[s, _NEAR, i, 1 + border] = roles[s, _NEAR, 1 + border, i] = True
            for b in range(things):
                if b == a or not present[s, b]:
                    continue
                j = 1 + _N_BORDERS + b
                dx, dy = centres[s, b, 0] - x, centres[s, b, 1] - y
                roles[s, _LEFT, i, j] = roles[s, _RIGHT, j, i] = dx > 0
                roles[s, _ABOVE, i, j] = roles[s, _BELOW, j, i] = dy > 0
                gap_x = abs(dx) - half_x - sizes[b, 0] / 2
                gap_y = abs(dy) - half_y - sizes[b, 1] / 2
                gap = max(gap_x, gap_y)
                roles[s, _LEVEL, i, j] = gap_y <= 0
                roles[s, _TOUCHES, i, j] = gap <= TOUCHING_PERCENT
                roles[s, _NEAR, i, j] = gap <= NEAR_PERCENT
                roles[s, _APPROACHES, i, j] = vx * dx + vy * dy > 0
