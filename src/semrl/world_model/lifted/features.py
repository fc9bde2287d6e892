"""What is asked of a thing: its own motion, how far borders and the nearest thing of each family are; compiled.

All is relative, so what was learned of one thing holds for each of its concept, wherever it is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.concepts.geometry import FAR_PX, NEVER, gap, meeting, time_to_contact
from semrl.concepts.scenes import AGE, CONCEPT, HEIGHT, VX, VX_1, VX_2, VY, VY_1, VY_2, WIDTH, X, Y
from semrl.core import Floats, Ints
from semrl.core.kernels import compiled

OWN_NAMES = (
    "vx", "vy", "last vx", "last vy", "vx 2 ago", "vy 2 ago",
    "left", "top", "right", "bottom", "next left", "next top", "next right", "next bottom",
    "age", "the action", "the action 1 before", "the action 2 before", "the action 3 before",
)  # fmt: skip
"""Of a thing's own numbers; an edge is ``next`` where it will be if it goes on."""

RELATION_NAMES = (
    "there", "gap x", "gap y", "next gap x", "next gap y", "dx", "dy", "next dx", "next dy", "relative vx",
    "relative vy", "touching", "touching next", "time to meet in x", "gap y then", "dy then", "time to meet in y",
    "gap x then", "dx then", "next |dy|",
)  # fmt: skip
"""Of what relates a thing to the nearest one of a family."""

N_OWN, N_RELATION = len(OWN_NAMES), len(RELATION_NAMES)
PAST_ACTIONS = 3
ACTION = 15
"""Column of the action; those before it follow."""
TOUCHING_NEXT = 12
"""Place of this among the numbers of a relation."""


class Kinds(NamedTuple):
    """What the trees know of concepts."""

    relation_of: Ints
    """``(c,)`` int64: which relation is about things of this concept; −1: none."""
    moving: NDArray[np.bool_]
    controlled: NDArray[np.bool_]
    """``(c,)``: whether things of it move, and by actions."""


def feature_names(families: Sequence[str]) -> list[str]:
    """Name the columns of `describe`, given the names of the families that things are related to."""
    return [*OWN_NAMES, *(f"{name} of {family}" for family in families for name in RELATION_NAMES)]


@compiled
def width(relations: int) -> int:
    """Return how many numbers `describe` writes."""
    return N_OWN + N_RELATION * relations


@compiled
def describe(objects: Floats, i: int, actions: Floats, kinds: Kinds, row: Floats) -> None:
    """Write what is asked of object `i` of ``(k, 14)`` into ``(f,)``.

    `actions` are ``(4,)``: the present one and those before, the newest first.
    """
    one = objects[i]
    row[0], row[1] = one[VX], one[VY]
    row[2], row[3], row[4], row[5] = one[VX_1], one[VY_1], one[VX_2], one[VY_2]
    half_x, half_y = one[WIDTH] / 2, one[HEIGHT] / 2
    row[6], row[7], row[8], row[9] = one[X] - half_x, one[Y] - half_y, one[X] + half_x, one[Y] + half_y
    row[10], row[11], row[12], row[13] = row[6] + one[VX], row[7] + one[VY], row[8] + one[VX], row[9] + one[VY]
    row[14] = one[AGE]
    controlled = kinds.controlled[int(one[CONCEPT])]
    for k in range(4):
        row[ACTION + k] = actions[k] if controlled else 0
    for relation in range((len(row) - N_OWN) // N_RELATION):
        j = _nearest(objects, i, relation, kinds)
        part = row[N_OWN + N_RELATION * relation : N_OWN + N_RELATION * (relation + 1)]
        if j < 0:
            part[:] = FAR_PX
            part[0] = part[11] = part[TOUCHING_NEXT] = 0
        else:
            _relate(one, objects[j], part)


@compiled
def _nearest(objects: Floats, i: int, relation: int, kinds: Kinds) -> int:
    """Return the object of a family that is nearest if all go on; −1 where there is none."""
    best, nearest = 1e9, -1
    one = objects[i]
    for j in range(len(objects)):
        concept = int(objects[j, CONCEPT])
        if j == i or concept < 0 or kinds.relation_of[concept] != relation:
            continue
        other = objects[j]
        x = gap(other[X] + other[VX] - one[X] - one[VX], (other[WIDTH] + one[WIDTH]) / 2)
        y = gap(other[Y] + other[VY] - one[Y] - one[VY], (other[HEIGHT] + one[HEIGHT]) / 2)
        if max(x, y) < best:
            best, nearest = max(x, y), j
    return nearest


@compiled
def _relate(one: Floats, other: Floats, part: Floats) -> None:
    """Write how another object lies to one, see `RELATION_NAMES`."""
    dx, dy = other[X] - one[X], other[Y] - one[Y]
    rvx, rvy = other[VX] - one[VX], other[VY] - one[VY]
    reach_x, reach_y = (other[WIDTH] + one[WIDTH]) / 2, (other[HEIGHT] + one[HEIGHT]) / 2
    part[0] = 1
    part[1], part[2] = gap(dx, reach_x), gap(dy, reach_y)
    part[3], part[4] = gap(dx + rvx, reach_x), gap(dy + rvy, reach_y)
    part[5], part[6], part[7], part[8], part[9], part[10] = dx, dy, dx + rvx, dy + rvy, rvx, rvy
    part[11] = 1.0 if part[1] <= 0 and part[2] <= 0 else 0.0
    part[TOUCHING_NEXT] = 1.0 if time_to_contact(dx, dy, rvx, rvy, reach_x, reach_y) <= 1 else 0.0
    part[13:19] = FAR_PX
    part[13], part[16] = meeting(dx, rvx, reach_x), meeting(dy, rvy, reach_y)
    if part[13] < NEVER:
        part[15] = dy + rvy * part[13]
        part[14] = gap(part[15], reach_y)
    if part[16] < NEVER:
        part[18] = dx + rvx * part[16]
        part[17] = gap(part[18], reach_x)
    part[19] = abs(part[8])
