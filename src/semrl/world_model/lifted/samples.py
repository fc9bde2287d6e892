"""What decision lists are read from and checked on: every thing of a concept at every decision, and what came of it."""

from typing import NamedTuple

import numpy as np

from semrl.concepts.scenes import CONCEPT
from semrl.core import Floats, Ints
from semrl.world_model.lifted.features import Kinds
from semrl.world_model.lifted.play import LATER_VX, TARGETS, Play

REWARD_COLUMN = TARGETS.index("reward")
"""Column of what a decision brings."""

LATER_REWARD = LATER_VX + 2
LATER_ACTION = LATER_REWARD + 1
"""Behind the targets of a world model: what the next decision brings, and what is done then; not a number at an end."""


class Samples(NamedTuple):
    """Things at decisions."""

    rows: Floats
    """``(n, f)``, see `semrl.world_model.lifted.features.describe`."""
    targets: Floats
    """``(n, 12)``, see `semrl.world_model.lifted.play.TARGETS` and `LATER_REWARD`; a reward is its sign, and none is
    known right after another one: what is seen then has had its own."""
    things: Ints
    """``(n,)``, places among the objects."""
    decisions: Ints
    """``(n,)``, places among the states of the play."""


def samples_of(play: Play, objects: Floats, concept: int, kinds: Kinds) -> Samples:
    """Return the samples of a concept in some play, of which the objects are given (`Play.objects`)."""
    rows, targets = play.rows(objects, concept, kinds, discount=1.0)
    decisions = np.repeat(np.arange(len(play)), play.sizes)
    things = np.flatnonzero((objects[:, CONCEPT] == concept) & (play.actions[decisions] >= 0))
    decisions = decisions[things]
    before, after = np.maximum(decisions - 1, 0), np.minimum(decisions + 1, len(play) - 1)
    signs = np.sign(play.rewards)
    had = (play.actions[before] >= 0) & (signs[before] != 0) & (signs[decisions] == 0) & (before < decisions)
    targets[had, REWARD_COLUMN] = np.nan
    goes_on = play.actions[after] >= 0
    later = (np.where(goes_on, column[after], np.nan) for column in (signs, play.actions))
    return Samples(rows, np.column_stack([targets, *later]).astype(np.float32), things, decisions)
