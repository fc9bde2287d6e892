"""What is known of each role: how it looks, where it stays, how often it moves, beside whom it is seen."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, Tracks
from semrl.core.arrays import Arrays
from semrl.core.kernels import compiled
from semrl.core.protocols import Saved
from semrl.core.things import LEAST_MOVING_SHARE
from semrl.perception.tracking.mobility import STEADY_DECISIONS

NEVER = 1e6
"""What it costs to give a track a role that it cannot have."""

_WIDTH_PX, _WIDTH_COUNT = 20.0, 30
"""Before a role was seen much it is believed to stay within such a deviation, as if seen so many times."""

MOST_TOGETHER = 0.05
"""Share of the frames with the rarer of two roles, up to which the other is seen in them too if they take turns."""

# In nats. Who has a role and is seen keeps it in doubt, whatever it looks like just now; who has it and is not seen
# gives it up more easily. A newcomer must look and move alike; its place decides between several.
_KEEPS, _GIVES_UP, _MOST_UNREST, _MOST_NEW = 2.0, 2.0, 4.0, 6.0


HABITS = ("row", "column", "height", "width", "step down", "step across", "red", "green", "blue")
"""What is measured of an object: its centre, its size, how far it goes in a decision, whichever way, in pixels of the
84×84 image; and its mean colour."""


class Known(NamedTuple):
    """What tracks are measured against, for k roles."""

    roles: Ints
    """``(k,)`` int64, their numbers."""
    surprises: NDArray[np.float64]
    """``(k, c + 1)``, minus the logarithm of the share of each class, the last for all classes never seen."""
    tint_surprises: NDArray[np.float64]
    """``(k, t + 1)``, the same of the colours; see `semrl.perception.tracking.tints`."""
    means_px: NDArray[np.float64]
    variances: NDArray[np.float64]
    """``(k, 2)``, of the centres."""
    mobilities: NDArray[np.float64]
    """``(k,)``, share of the decisions at which it moves."""


class SlotStatistics(Saved):
    """Counts of each role, from which the likelihood of a track follows (naive Bayes).

    Attributes
    ----------
    classes
        ``(r, c)`` float64, how often each role was seen as of each class.
    tints
        ``(r, t)`` float64, how often in each colour.
    means
        ``(r, 2)`` float64, mean centre, row and column in pixels.
    deviations
        ``(r, 2)`` float64, sums of squared deviations from these.
    moves
        ``(r, 2)`` float64, decisions at which it moved, and at which it could have.
    together
        ``(r, r)`` float64, frames in which each two were seen; on the diagonal, each.
    habits
        ``(r, 9, 3)`` float64, of each of `HABITS` how often it was measured, and the sums of it and of its squares.
    """

    SAVED = ("classes", "tints", "means", "deviations", "moves", "together", "habits")

    def __init__(self) -> None:
        self.classes: NDArray[np.float64] = np.zeros((0, 0))
        self.tints: NDArray[np.float64] = np.zeros((0, 0))
        self.means: NDArray[np.float64] = np.zeros((0, 2))
        self.deviations: NDArray[np.float64] = np.zeros((0, 2))
        self.moves: NDArray[np.float64] = np.zeros((0, 2))
        self.together: NDArray[np.float64] = np.zeros((0, 0))
        self.habits: NDArray[np.float64] = np.zeros((0, len(HABITS), 3))

    def __len__(self) -> int:
        return len(self.means)

    @property
    def seen(self) -> NDArray[np.float64]:
        """How often each role was seen, ``(r,)``."""
        return np.asarray(self.classes.sum(axis=1))

    @property
    def spreads_px(self) -> NDArray[np.float64]:
        """How far each role strays from its mean place, ``(r,)``, standard deviation in pixels."""
        return np.asarray(np.sqrt(self.deviations.sum(axis=1) / np.maximum(self.seen, 1)))

    def found(self) -> None:
        """Make room for one more role."""
        wider = ((0, 1), (0, 0))
        for name in ("classes", "tints", "means", "deviations", "moves"):
            setattr(self, name, np.pad(getattr(self, name), wider))
        self.together = np.pad(self.together, ((0, 1), (0, 1)))
        self.habits = np.pad(self.habits, (*wider, (0, 0)))

    def count(self, tracks: Tracks, tints: Ints, shown: Ints, roles: Ints, moved: NDArray[np.bool_]) -> None:
        """Count one frame.

        Parameters
        ----------
        tracks
            As of now.
        tints
            ``(m,)``, the colour of each of all of them.
        shown
            ``(n,)``, places in it of those that are seen and have a role.
        roles
            ``(n,)``, theirs, each at most once.
        moved
            ``(n,)``, whether each moved since the frame before.
        """
        self.classes = _counted(self.classes, roles, tracks.classes[shown])
        self.tints = _counted(self.tints, roles, tints[shown])
        away = tracks.centres_px[shown] - self.means[roles]  # Welford: from the old mean, then from the new one
        self.means[roles] += away / self.seen[roles, None]
        self.deviations[roles] += away * (tracks.centres_px[shown] - self.means[roles])
        self.moves[roles] += np.column_stack([moved, tracks.ages[shown] > 0])
        self.together[np.ix_(roles, roles)] += 1
        measured = habits_of(tracks)[shown]
        self.habits[roles] += np.stack([np.ones_like(measured), measured, np.square(measured)], axis=2)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what was saved; runs that are older than this have no habits, or no colours."""
        n_roles = len(arrays.get("means", ()))
        super().from_arrays({"habits": np.zeros((n_roles, len(HABITS), 3)), "tints": np.zeros((n_roles, 0)), **arrays})

    def take_turns(self, role: int, other: int) -> bool:
        """Tell whether two roles are hardly ever seen at once."""
        rarer = self.together[[role, other], [role, other]].min()
        return bool(self.together[role, other] <= MOST_TOGETHER * rarer)

    def merge(self, role: int, other: int) -> None:
        """Let one role have all that was counted of another, which is left with nothing."""
        seen, more = self.seen[[role, other]]
        way = self.means[other] - self.means[role]
        self.means[role] += way * more / (seen + more)
        self.deviations[role] += self.deviations[other] + way**2 * seen * more / (seen + more)  # Chan et al. (1979)
        for counts in (self.classes, self.tints, self.moves, self.habits, self.together, self.together.T):
            counts[role] += counts[other]
            counts[other] = 0
        self.deviations[other] = 0

    def known(self, roles: Ints) -> Known:
        """Return what tracks are measured against, for some roles."""
        seen = self.seen[roles, None]
        return Known(
            roles=roles,
            surprises=_surprises(self.classes[roles]),
            tint_surprises=_surprises(self.tints[roles]),
            means_px=self.means[roles],
            variances=(self.deviations[roles] + _WIDTH_COUNT * _WIDTH_PX**2) / (seen + _WIDTH_COUNT),
            mobilities=(self.moves[roles, 0] + 1) / (self.moves[roles, 1] + 2),
        )


def habits_of(tracks: Tracks) -> NDArray[np.float64]:
    """Return what `HABITS` are of each track, ``(n, 9)`` float64."""
    left, top, right, bottom = tracks.edges_px.T
    sizes = np.column_stack([bottom - top, right - left])
    parts = [tracks.centres_px, sizes, np.abs(tracks.velocities_px), tracks.colours]
    return np.concatenate(parts, axis=1, dtype=np.float64)


def _counted(counts: NDArray[np.float64], roles: Ints, looks: Ints) -> NDArray[np.float64]:
    """Return ``(r, c)`` counts, wider where need be, with one more of a look, ``(n,)``, of each of some roles."""
    more = int(looks.max(initial=-1)) + 1 - counts.shape[1]
    counts = np.pad(counts, ((0, 0), (0, max(more, 0))))
    counts[roles, looks] += 1
    return counts


def _surprises(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return minus the logarithm of the share of each look in each role, ``(k, c + 1)``, the last of all others."""
    counts = np.pad(counts, ((0, 0), (0, 1)))
    return np.asarray(-np.log((counts + 0.1) / (counts.sum(axis=1, keepdims=True) + 0.1 * counts.shape[1])))


def costs(tracks: Tracks, tints: Ints, known: Known) -> NDArray[np.float64]:
    """Return minus the log-likelihood of each track, ``(n,)`` colours, in each of k roles, ``(n, k)``, in nats.

    `NEVER` stands where a track cannot have a role.
    """
    return _costs(
        tracks.classes, tints, tracks.centres_px, tracks.moves, tracks.ages, tracks.time_since_update, tracks.roles,
        known,
    )  # fmt: skip


@compiled
def _costs(  # noqa: PLR0917 - compiled functions take no keywords
    classes: Ints, tints: Ints, centres: Floats, moves: Ints, ages: Ints, time_since_update: Ints, held: Ints,
    known: Known,
) -> NDArray[np.float64]:  # fmt: skip
    n_classes, n_tints = known.surprises.shape[1], known.tint_surprises.shape[1]
    result = np.empty((len(classes), len(known.roles)))
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            strange, width = 0.0, 0.0
            for axis in range(2):
                away = centres[i, axis] - known.means_px[j, axis]
                strange += 0.5 * away * away / known.variances[j, axis]
                width += 0.5 * np.log(known.variances[j, axis])
            unrest = min(_misfit(moves[i], ages[i], known.mobilities[j]), _MOST_UNREST)
            if held[i] == known.roles[j]:
                total = strange + unrest + (_GIVES_UP if time_since_update[i] else -_KEEPS)
                possible = moves[i] > 0 or ages[i] < STEADY_DECISIONS
            else:
                looks = unrest + known.surprises[j, min(classes[i], n_classes - 1)]
                looks += known.tint_surprises[j, min(tints[i], n_tints - 1)]
                total = strange + looks
                possible = looks <= _MOST_NEW and (
                    moves[i] >= LEAST_MOVING_SHARE * ages[i] or ages[i] < STEADY_DECISIONS
                )
            result[i, j] = total + width if possible else NEVER
    return result


@compiled
def _misfit(moves: int, ages: int, mobility: float) -> float:
    """Return how much likelier so many moves are with their own rate than with the role's, in nats."""
    total = 0.0
    for n, rate in ((moves, mobility), (ages - moves, 1 - mobility)):
        if n > 0:
            total += n * np.log(n / (ages * rate))
    return total
