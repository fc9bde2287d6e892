"""Objects matched from decision to decision: who is who."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from semrl.core import IMAGE_SIZE_PX, Floats, Ints, Objects, Tracks
from semrl.core.arrays import Arrays
from semrl.core.errors import UsageError
from semrl.perception.tracking.following_kernels import NO_MATCH, Seen, State, exchange_partners, match_costs, move_on

MOVED_PX = 0.2
"""What went farther than this in one decision has moved; a pixel of an Atari frame is 0.4 px high and 0.5 px wide."""


@dataclass(frozen=True, kw_only=True)
class TrackingConfig:
    """Which object of a frame is which of the frame before."""

    gate_px: float = 10.0
    """Farthest from where it is expected that an object is still the same, where play shows no jumps."""
    class_cost: float = 0.5
    """What another class costs, against 1 for lying at the gate."""
    appearance_cost: float = 1.0
    """What another appearance costs, times the squared distance of the reduced objects, from 1 on no more."""
    unseen_decisions: int = 4
    """Decisions for which an object that is not seen is expected back."""

    def __post_init__(self) -> None:
        if not self.gate_px > 0:
            raise UsageError(f"tracking.gate_px must be above 0, not {self.gate_px}")
        if min(self.class_cost, self.appearance_cost, self.unseen_decisions) < 0:
            raise UsageError("tracking.class_cost, appearance_cost and unseen_decisions must be 0 or more")


def no_tracks(n_features: int) -> Tracks:
    """Return the tracks at the beginning of an episode: none, of objects described by so many numbers."""
    numbers, points = np.zeros(0, np.int64), np.zeros((0, 2), np.float32)
    return Tracks(
        ids=numbers, classes=numbers, features=np.zeros((0, n_features), np.float32), centres_px=points,
        boxes_px=np.zeros((0, 4), np.int64), edges_px=np.zeros((0, 4), np.float32), velocities_px=points, ages=numbers,
        moves=numbers, time_since_update=numbers, colours=np.zeros((0, 3), np.float32), roles=numbers,
        born=np.array(0, np.int64),
    )  # fmt: skip


def follow(
    tracks: Tracks, objects: Objects, classes: Ints, features: Floats, config: TrackingConfig, *, reach_px: float = 0.0
) -> Tracks:
    """Find the tracks again in the objects of the next frame.

    Every object goes to at most one track so that the sum of all costs is least (Hungarian assignment, as in
    Bewley et al., "Simple online and realtime tracking", ICIP 2016): the squared distance to where the track is
    expected, in gates, plus what another class and another appearance cost. A track without an object goes on as
    it went, unseen, for a while; an object without a track begins one. Where things jump, what is left over is
    matched once more, within reach of a jump. Two tracks that would exchange their colours exchange their objects.

    Parameters
    ----------
    tracks
        As of the decision before.
    objects
        Of this frame, n of them.
    classes
        ``(n,)``, their classes.
    features
        ``(n, k)`` float32, their reduced appearance.
    config
        See `TrackingConfig`.
    reach_px
        How far things jump, as `Jumps` has learned; they do not where it is no farther than the gate.
    """
    before = State(*(getattr(tracks, name) for name in State._fields))
    edges = edges_of(objects.boxes_px) if objects.edges_px is None else objects.edges_px
    colours = np.zeros((len(objects), 3), np.float32) if objects.colours is None else objects.colours
    seen = Seen(classes, features, objects.centres_px, objects.boxes_px, edges, colours)
    partners = _matched(match_costs(before, seen, config.gate_px, config.class_cost, config.appearance_cost))
    if reach_px > config.gate_px:
        costs = match_costs(before, seen, reach_px, config.class_cost, config.appearance_cost)
        left, free = np.flatnonzero(partners < 0), np.setdiff1d(np.arange(len(classes)), partners)
        found = _matched(costs[np.ix_(left, free)])
        partners[left[found >= 0]] = free[found[found >= 0]]
    exchange_partners(partners, before, seen)
    after = move_on(before, seen, partners, int(tracks.born), config.unseen_decisions, MOVED_PX, IMAGE_SIZE_PX - 1)
    born = max(int(tracks.born), int(after.ids[-1]) + 1) if len(after.ids) else int(tracks.born)
    return Tracks(**after._asdict(), born=np.array(born))


def restored_tracks(arrays: Arrays) -> Tracks:
    """Return tracks that were saved; those of older runs have no colours."""
    none = np.zeros((len(arrays["ids"]), 3), np.float32)
    return Tracks(**{"colours": none, **arrays})


def edges_of(boxes_px: Ints) -> Floats:
    """Return left, top, right and bottom, ``(n, 4)`` float32, of boxes, top, left, height and width."""
    top, left, height, width = boxes_px.T
    return np.column_stack([left, top, left + width, top + height]).astype(np.float32)


def _matched(costs: NDArray[np.float64]) -> Ints:
    """Return the column of each row of ``(t, n)`` costs so that they cost least together, ``(t,)``; -1 for none."""
    rows, columns = linear_sum_assignment(costs)
    partners = np.full(len(costs), -1, np.int64)
    partners[rows] = np.where(costs[rows, columns] < NO_MATCH, columns, -1)
    return partners
