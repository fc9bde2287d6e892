"""The compiled half of following: the few objects of a frame are many small steps for numpy."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.perception.tracking.tints import ALIKE

NO_MATCH = 1e6
"""What it costs to take an object for a track that it cannot be."""

TURN_PX = 2.0
"""What it costs to believe that an object turned, in pixels, against believing that it went on."""


class State(NamedTuple):
    """The arrays of `Tracks` that change from decision to decision, in its order."""

    ids: Ints
    classes: Ints
    features: Floats
    centres_px: Floats
    boxes_px: Ints
    edges_px: Floats
    velocities_px: Floats
    ages: Ints
    time_since_update: Ints
    moves: Ints
    colours: Floats
    roles: Ints


class Seen(NamedTuple):
    """The objects of a frame."""

    classes: Ints
    features: Floats
    centres_px: Floats
    boxes_px: Ints
    edges_px: Floats
    colours: Floats


@compiled
def match_costs(
    tracks: State, seen: Seen, gate_px: float, class_cost: float, appearance_cost: float
) -> NDArray[np.float64]:
    """Return what it costs to take each object for each track, ``(t, n)``."""
    costs = np.empty((len(tracks.ids), len(seen.classes)))
    for i in range(costs.shape[0]):
        down, right = tracks.velocities_px[i]
        reach = np.hypot(down, right) * (1 + 2 * tracks.time_since_update[i])
        for j in range(costs.shape[1]):
            y, x = seen.centres_px[j] - tracks.centres_px[i]
            # What bounced is not where it was heading, but no farther from where it was seen than it would be.
            turned = max(np.hypot(y, x) - reach, 0.0) + TURN_PX
            distance = min(np.hypot(y - down, x - right), turned)
            change = 0.0
            for k in range(seen.features.shape[1]):
                change += (seen.features[j, k] - tracks.features[i, k]) ** 2
            costs[i, j] = (distance / gate_px) ** 2 + appearance_cost * min(change, 1.0)
            if seen.classes[j] != tracks.classes[i]:
                costs[i, j] += class_cost
            if distance > gate_px:
                costs[i, j] = NO_MATCH
    return costs


@compiled
def exchange_partners(partners: Ints, tracks: State, seen: Seen) -> None:
    """Give two tracks each other's object, in place, where each object has the colour of the other track alone.

    Things that exchange their places in one decision, as players that change ends, would else exchange their colours.
    """
    for i in range(len(partners)):
        p = partners[i]
        if p < 0 or _alike(tracks.colours[i], seen.colours[p]):
            continue
        for j in range(len(partners)):
            q = partners[j]
            if q < 0 or not _alike(tracks.colours[i], seen.colours[q]):
                continue
            if _alike(tracks.colours[j], seen.colours[p]) and not _alike(tracks.colours[j], seen.colours[q]):
                partners[i], partners[j] = q, p
                break


@compiled
def _alike(one: Floats, other: Floats) -> bool:
    """Tell whether two colours are one."""
    most = 0.0
    for channel in range(3):
        most = max(most, abs(one[channel] - other[channel]))
    return most <= ALIKE


@compiled
def move_on(  # noqa: PLR0917 - compiled functions take no keywords
    tracks: State, seen: Seen, partners: Ints, born: int, longest: int, moved_px: float, last_px: int
) -> State:
    """Make the tracks of the next decision.

    Parameters
    ----------
    tracks, seen
        Those of the decision before, and what is seen now.
    partners
        ``(t,)``, the object that each track is found in; −1 for none.
    born
        The next identity.
    longest
        Decisions that a track may stay unseen.
    moved_px
        What went farther has moved.
    last_px
        Where the image ends.
    """
    taken = np.zeros(len(seen.classes), np.bool_)
    for j in partners:
        if j >= 0:
            taken[j] = True
    kept = np.flatnonzero((partners >= 0) | (tracks.time_since_update < longest))
    n_old, n = len(kept), len(kept) + int(np.sum(~taken))
    after = State(
        np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, seen.features.shape[1]), np.float32),
        np.empty((n, 2), np.float32), np.empty((n, 4), np.int64), np.empty((n, 4), np.float32),
        np.zeros((n, 2), np.float32),
        np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64), np.empty((n, 3), np.float32),
        np.full(n, -1, np.int64),
    )  # fmt: skip
    for i in range(n_old):
        old = int(kept[i])
        _keep(after, i, tracks, old, last_px)
        if partners[old] >= 0:
            _find(after, i, tracks, old, seen, int(partners[old]), moved_px)
    for k, j in enumerate(np.flatnonzero(~taken)):
        after.ids[n_old + k] = born + k
        _show(after, n_old + k, seen, int(j))
    return after


@compiled
def _keep(after: State, i: int, before: State, old: int, last_px: int) -> None:
    """Let a track go on as it went, unseen, within the image."""
    after.ids[i], after.classes[i] = before.ids[old], before.classes[old]
    after.features[i], after.boxes_px[i] = before.features[old], before.boxes_px[old]
    after.edges_px[i], after.colours[i] = before.edges_px[old], before.colours[old]
    after.velocities_px[i] = before.velocities_px[old]
    after.ages[i], after.time_since_update[i] = before.ages[old] + 1, before.time_since_update[old] + 1
    after.moves[i], after.roles[i] = before.moves[old], before.roles[old]
    for axis in range(2):
        place = before.centres_px[old, axis] + before.velocities_px[old, axis]
        after.centres_px[i, axis] = min(max(place, 0.0), last_px)


@compiled
def _find(  # noqa: PLR0917
    after: State, i: int, before: State, old: int, seen: Seen, j: int, moved_px: float
) -> None:
    """Move a track to the object that it was found in."""
    step = seen.centres_px[j] - before.centres_px[old]
    gap = before.time_since_update[old]
    # While it was not seen its place was moved on by its velocity: the whole way is both together.
    way = step + before.velocities_px[old] * gap
    after.velocities_px[i] = way / (gap + 1)
    if _shifted(before.edges_px[old], seen.edges_px[j]) > moved_px:
        after.moves[i] += 1
    after.time_since_update[i] = 0
    _show(after, i, seen, j)


@compiled
def _shifted(before: Floats, now: Floats) -> float:
    """Return how far a box went as a whole, both edges of a pair: what only grows or shrinks stays where it is."""
    total = 0.0
    for low in range(2):
        one, other = now[low] - before[low], now[low + 2] - before[low + 2]
        if one * other > 0:
            total += min(abs(one), abs(other)) ** 2
    return float(np.sqrt(total))


@compiled
def _show(after: State, i: int, seen: Seen, j: int) -> None:
    """Take over what an object looks like and where it is."""
    after.classes[i], after.features[i] = seen.classes[j], seen.features[j]
    after.centres_px[i], after.boxes_px[i] = seen.centres_px[j], seen.boxes_px[j]
    after.edges_px[i], after.colours[i] = seen.edges_px[j], seen.colours[j]
