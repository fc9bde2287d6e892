"""How two boxes lie to each other along an axis, now and later: the numbers behind relations; compiled."""

import numpy as np

from semrl.core.kernels import compiled

FAR_PX = 999.0
"""Stands for a distance where there is nothing."""

NEVER = 99.0
"""Decisions: at least as long as this is for ever."""


@compiled
def gap(apart: float, reach: float) -> float:
    """Return the gap between two intervals: the distance of their middles less half of both lengths."""
    return abs(apart) - reach


@compiled
def meeting(apart: float, closing: float, reach: float) -> float:
    """Return in how many decisions two intervals meet, 0 where they do, `NEVER` where they never will.

    Parameters
    ----------
    apart
        Middle of the other less that of this one.
    closing
        How much that changes a decision.
    reach
        Half of both lengths.
    """
    between = abs(apart) - reach
    if between <= 0:
        return 0.0
    if apart * closing >= 0:
        return NEVER
    return min(between / abs(closing), NEVER)


@compiled
def parting(apart: float, closing: float, reach: float) -> float:
    """Return in how many decisions two intervals that meet, or will, have passed each other; `NEVER` at rest."""
    if closing == 0:
        return NEVER if abs(apart) <= reach else 0.0
    return float(max((reach + np.sign(closing) * -apart) / abs(closing), 0.0))


@compiled
def time_to_contact(  # noqa: PLR0917 - compiled functions take no keywords
    dx: float, dy: float, rvx: float, rvy: float, reach_x: float, reach_y: float
) -> float:
    """Return in how many decisions two boxes touch if both go on as they do, 0 where they do; `NEVER` if never.

    The way between is swept: a box that is on this side now and on the other one decision later has touched.
    """
    begin = max(meeting(dx, rvx, reach_x), meeting(dy, rvy, reach_y))
    end = min(parting(dx, rvx, reach_x), parting(dy, rvy, reach_y))
    return begin if begin <= end and begin < NEVER else NEVER
