"""Things as they were seen at one decision: plain rows, which are stored and compared quickly."""

import numpy as np
from numpy.typing import NDArray

from semrl.core.named import Floats, Ints
from semrl.core.seen import Tracks

ID, KIND, STILL, OWN, SLOT, LEFT, TOP, RIGHT, BOTTOM = range(9)
"""Columns of a thing: identity in the episode, kind (class number, §3.2.2, or one for a class and colour), 1 if
it stays where it is, 1 if actions move it, its place in the list of tracked objects (−1: none), its edges in pixels of
the 84×84 image, the last two exclusive."""

GROUND = 2
"""In place of 1 in the column `STILL`: a piece of the background, of which the class number is that of its colour."""

COLUMNS = 9

SLOT_NUMBERS = 3
"""What the list of tracked objects holds of each: x, y and whether it is seen."""

MAX_SLOTS = 64
"""Longest such list."""

LEAST_MOVING_SHARE = 0.05
"""Share of the decisions at which a thing must have moved, else it is scenery: still, unless it has a slot, or its kind
tells otherwise."""


def no_things() -> Floats:
    """Return the things of a decision at which nothing is seen, ``(0, 9)`` float32."""
    return np.zeros((0, COLUMNS), np.float32)


def things_of(tracks: Tracks, kinds: Ints, stays: NDArray[np.bool_], slots: Floats, own: Floats) -> Floats:
    """Write the tracks that are seen as things, ``(n, 9)`` float32, in the order of their identities.

    Parameters
    ----------
    tracks
        With their roles.
    kinds, stays
        ``(n,)``, of each, and whether it is scenery, unless it has a slot.
    slots, own
        ``(r + 1,)`` for each role, and at the end for what has none: its slot, and 1 where actions move it.
    """
    seen = np.flatnonzero(tracks.time_since_update == 0)
    roles = tracks.roles[seen]
    things = np.empty((len(seen), COLUMNS), np.float32)
    things[:, ID], things[:, KIND] = tracks.ids[seen], kinds[seen]
    things[:, OWN], things[:, SLOT] = own[roles], slots[roles]
    things[:, STILL] = stays[seen] & (things[:, SLOT] < 0)
    things[:, LEFT:] = tracks.edges_px[seen]
    return things
