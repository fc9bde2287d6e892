"""Which tracks matter, and which place in the state each has: learned from how things move."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from semrl.core import IMAGE_SIZE_PX, Floats, Ints, Tracks
from semrl.core.errors import DataError, UsageError
from semrl.core.kernels import compiled
from semrl.core.protocols import Saved
from semrl.core.things import LEAST_MOVING_SHARE, MAX_SLOTS, things_of
from semrl.perception.tracking.controllability import Controllability
from semrl.perception.tracking.following import MOVED_PX
from semrl.perception.tracking.mobility import Mobility, moving
from semrl.perception.tracking.slot_statistics import HABITS, NEVER, SlotStatistics, costs
from semrl.perception.tracking.tints import Tints

SLOT_NUMBERS = ("x", "y", "seen")
"""What each slot holds."""

SIZED_NUMBERS = ("x", "y", "width", "height", "seen")
"""What it holds where sizes count."""

AXES = ("x", "y", "width", "height")
"""Those of them that are measured along the image, in the order of `StateSpace.axes`."""

LEAST_SEEN_SHARE = 0.02
"""Share of the decisions at which a role must have been seen."""

LEAST_SPREAD_PX = 2.0
"""Standard deviation of its places that a role must have: the digits of a clock change, but stay where they are."""

LEAST_CONTROLLABILITY = 0.2
"""Share of the variance of a role's steps that the actions must explain, else it is not controlled."""

FEWEST_SLOTS, MOST_SLOTS = 8, 12
"""Slots that a game of few things has, and one of many, where things are counted (`SlotAssignerConfig.slots` 0)."""


@dataclass(frozen=True, kw_only=True)
class SlotAssignerConfig:
    """What of the tracks an agent is shown."""

    frames: int = 500
    """Frames of random play in which roles are learned."""
    slots: int = 8
    """Most roles that an agent is shown: what it controls, then those seen most; 0: one more than things mostly move at
    once in the random play that perception learns from, 8 to 12."""
    sizes: bool = False
    """Whether it is shown their width and height as well: where things stretch, fall or come nearer."""

    @property
    def numbers(self) -> tuple[str, ...]:
        """What each slot holds."""
        return SIZED_NUMBERS if self.sizes else SLOT_NUMBERS

    def __post_init__(self) -> None:
        if self.frames < 1 or self.slots < 0:
            raise UsageError(
                f"slot_assigner.frames must be 1 or more and .slots 0 or more, not {self.frames} and {self.slots}"
            )


class SlotAssigner(Saved):
    """Parts that objects play again and again, and the fixed vector that describes them.

    Identities end with an episode, and sooner where an object leaves the image; a role stays. It is known by its
    habits: the classes and colours that were seen in it, where it stays and how often it moves. A track that has moved
    and fits no free role founds one. Whoever fits best has the role (all pairs at once, by likelihood; who has it
    keeps it if in doubt). After `frames` of random play roles that take turns become one, if they are of one kind or
    actions move both, and the roles that move are given slots, ordered by kind, the older first; what stands still gets
    none. Whether the actions move it is measured as well: see `Controllability`.

    Attributes
    ----------
    frames_ : int
        Frames seen so far.
    slots_ : ndarray
        ``(k,)`` int64, the role in each slot, at most ``config.slots``; empty while roles are still being learned.
    """

    SAVED, PARTS = ("frames_", "slots_"), ("_statistics", "_controllability", "_tints", "_mobility")

    def __init__(self, config: SlotAssignerConfig | None = None) -> None:
        config = config or SlotAssignerConfig()
        self.config = config if config.slots else replace(config, slots=FEWEST_SLOTS)  # where nobody has counted
        self.frames_ = 0
        self.slots_: Ints = np.zeros(0, np.int64)
        self._statistics = SlotStatistics()
        self._controllability = Controllability()
        self._tints = Tints()
        self._mobility = Mobility()
        self._know()

    @property
    def dimension(self) -> int:
        """Length of the vectors."""
        return self.config.slots * len(self.config.numbers)

    @property
    def is_fitted(self) -> bool:
        """Whether enough was seen to give slots."""
        return self.frames_ >= self.config.frames

    @property
    def kinds_(self) -> Ints:
        """The class that each role mostly has, ``(r,)`` int64."""
        return np.asarray(self._statistics.classes.argmax(axis=1)) if len(self._statistics) else np.zeros(0, np.int64)

    @property
    def means_px_(self) -> NDArray[np.float64]:
        """Mean centre of each role, ``(r, 2)``, row and column."""
        return self._statistics.means.copy()

    @property
    def seen_(self) -> NDArray[np.float64]:
        """Share of the frames in which each role was seen, ``(r,)``."""
        return np.asarray(self._statistics.seen / max(self.frames_, 1))

    @property
    def moving_(self) -> NDArray[np.float64]:
        """Share of the decisions at which each role moved, ``(r,)``."""
        moved, could = self._statistics.moves.T
        return np.asarray(moved / np.maximum(could, 1))

    @property
    def controllability_(self) -> NDArray[np.float64]:
        """Share of the variance of each role's steps that the actions explain, ``(r,)``."""
        return self._controllability.shares(len(self._statistics))

    @property
    def controlled_(self) -> NDArray[np.bool_]:
        """Whether the actions move each role, ``(r,)``."""
        return self.controllability_ >= LEAST_CONTROLLABILITY

    @property
    def names_(self) -> tuple[str, ...]:
        """What the roles in the slots are called: ``own`` is what the actions move, each other one an ``object``."""
        own = self.controlled_[self.slots_]
        return tuple(
            ("own" if own.sum() == 1 else f"own {i}") if mine else f"object {i}" for i, mine in enumerate(own.tolist())
        )

    def partial_fit(self, tracks: Tracks, action: int | None = None) -> Self:
        """Learn from one decision; they are expected in their order.

        Parameters
        ----------
        tracks
            As of now, with the roles that `predict` gave them before.
        action
            The one that led here; None at the beginning of an episode.
        """
        if self.is_fitted:
            return self
        self.frames_ += 1
        self._tints.learn(tracks.classes[tracks.visible], tracks.colours[tracks.visible])
        tints = self._tints.tints_of(tracks.colours)
        self._mobility.learn(tracks, tints)
        roles = self.predict(tracks)
        # What stands still has no part in it, or it would spoil the habits of a role that is free for a while.
        candidates = moving(tracks)
        for i in np.flatnonzero(candidates & (roles < 0)):
            if len(self._statistics) < MAX_SLOTS:
                roles[i] = len(self._statistics)
                self._statistics.found()
        shown = np.flatnonzero(candidates & (roles >= 0))
        steps = tracks.velocities_px[shown]
        self._statistics.count(tracks, tints, shown, roles[shown], moved=np.hypot(*steps.T) > MOVED_PX)
        old = tracks.ages[shown] > 0
        self._controllability.learn(action, roles[shown[old]], steps[old])
        if self.is_fitted:
            self._tints.settle()
            self._mobility.settle(self._tints.numbers_)
            self._merge()
            self.slots_ = self._give_slots()
        self._know()
        return self

    @property
    def shared_(self) -> NDArray[np.bool_]:
        """Whether other things may have each slot as well, ``(k,)``: all that moved while roles were learned had one.

        What actions move is alone.
        """
        room = bool(np.isin(np.flatnonzero(self._matter), self.slots_).all())
        return ~self.controlled_[self.slots_] & room

    @property
    def at_rest_(self) -> Floats:
        """The vector when nothing is there, as long as those of `transform`."""
        return self._at_rest.ravel()

    def costs(self, tracks: Tracks) -> NDArray[np.float64]:
        """Return what it costs that each track has each role with a slot, ``(n, k)``; `NEVER` where it cannot."""
        return costs(tracks, self._tints.tints_of(tracks.colours), self._known)

    def predict(self, tracks: Tracks) -> Ints:
        """Return the role of each track, ``(n,)`` int64; −1 for none.

        Raises
        ------
        DataError
            Nothing was learned yet.
        """
        if not self.frames_:
            raise DataError("no roles are known yet: call partial_fit first")
        matrix = self.costs(tracks)
        rows, columns = linear_sum_assignment(matrix)
        roles = np.full(len(tracks), -1, np.int64)
        roles[rows] = np.where(matrix[rows, columns] < NEVER, self._known.roles[columns], -1)
        return roles

    def transform(self, tracks: Tracks) -> Floats:
        """Write the tracks as a vector, ``(slots · 3,)`` float32: x and y in 0 … 1, and 1 if it is seen.

        Where sizes count it is ``(slots · 5,)``, width and height between them as shares of the image. A role that is
        not there has its mean place and size and is not seen; a slot without a role is zeros.

        Parameters
        ----------
        tracks
            With their roles.
        """
        vector = self._at_rest.copy()
        centres, sizes = tracks.centres_px, sizes_px(tracks)
        _write_slots(vector, self.slots_, tracks.roles, centres, sizes, tracks.time_since_update, IMAGE_SIZE_PX - 1)
        return vector.ravel()

    def things(self, tracks: Tracks) -> Floats:
        """Write all tracks that are seen as things, ``(n, 9)`` float32; see `semrl.core.things`.

        Parameters
        ----------
        tracks
            With their roles.
        """
        kinds = self.kinds(tracks)
        return things_of(tracks, kinds, self._mobility.stays(tracks, kinds), self._slot_of, self._moved_by_actions)

    def kinds(self, tracks: Tracks) -> Ints:
        """Return the kind of each track, ``(n,)`` int64: its class, and its colour where that says more."""
        return self._tints.kinds(tracks.classes, tracks.colours)

    def stays(self, tracks: Tracks) -> NDArray[np.bool_]:
        """Tell which tracks are scenery, ``(n,)``: such as hardly move, and are of no kind that does."""
        return self._mobility.stays(tracks, self.kinds(tracks))

    def is_new(self, tracks: Tracks) -> NDArray[np.bool_]:
        """Tell which tracks look as nothing looked while roles were learned, ``(n,)``: their class in their colour."""
        return self._tints.is_new(tracks.classes, tracks.colours)

    @property
    def habits_(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and variance of each of `HABITS` of the roles with slots, ``(k, 9)`` float64; 0 where none is known."""
        count, total, squares = np.moveaxis(self._statistics.habits[self.slots_], 2, 0)
        means = total / np.maximum(count, 1)
        return means, np.maximum(squares / np.maximum(count, 1) - np.square(means), 0)

    @property
    def colours_(self) -> Floats:
        """The colour in which each role with a slot was mostly seen, ``(k, 3)`` float32; its mean if that is not known.

        A mean of several may be the colour of nothing.
        """
        commonest = self._tints.commonest(self._statistics.tints[self.slots_])
        means = self.habits_[0][:, HABITS.index("red") :].astype(np.float32)
        return np.where(np.isnan(commonest), means, commonest)

    def read(self, vector: Floats) -> tuple[Ints, Floats]:
        """Read what is seen from a vector of `transform`: the kind of each object, ``(n,)``, and its centre.

        Centres are ``(n, 2)`` float32, row and column in pixels of the 84×84 image.
        """
        slots = vector.reshape(self.config.slots, len(self.config.numbers))[: len(self.slots_)]
        seen = slots[:, -1] > 0.5
        return self._slot_kinds[seen], slots[seen, 1::-1] * np.float32(IMAGE_SIZE_PX - 1)

    def _restored(self) -> None:
        self._know()

    @property
    def _matter(self) -> NDArray[np.bool_]:
        strays = self._statistics.spreads_px >= LEAST_SPREAD_PX
        return strays & (self.moving_ >= LEAST_MOVING_SHARE) & (self.seen_ >= LEAST_SEEN_SHARE)

    def _merge(self) -> None:
        """Make one of roles that matter, take turns, and are of one kind or are both moved by actions.

        An object that looked odd founded a second one; what is steered may look otherwise each way that it goes.
        """
        for role in np.argsort(-self.seen_, kind="stable").tolist():
            for other in range(len(self._statistics)):
                both = [role, other]
                alike = self.kinds_[role] == self.kinds_[other] or self.controlled_[both].all()
                if role != other and alike and self._matter[both].all() and self._statistics.take_turns(role, other):
                    self._statistics.merge(role, other)
                    self._controllability.merge(role, other)

    def _give_slots(self) -> Ints:
        """Choose the roles that move, those first that are controlled, then those seen most; order them by kind."""
        order = np.lexsort((-self.seen_, ~self.controlled_))
        roles = np.sort(order[self._matter[order]][: self.config.slots])
        return np.asarray(roles[np.argsort(self.kinds_[roles], kind="stable")])

    def _know(self) -> None:
        """Note what tracks are measured against, all roles while they are learned, then those with slots; and these."""
        self._known = self._statistics.known(self.slots_ if self.is_fitted else np.arange(len(self._statistics)))
        self._slot_kinds = self.kinds_[self.slots_]
        self._slot_of = np.full(len(self._statistics) + 1, -1, np.float32)
        self._slot_of[self.slots_] = np.arange(len(self.slots_))
        self._moved_by_actions = np.append(self.controlled_, False).astype(np.float32)
        self._at_rest: Floats = np.zeros((self.config.slots, len(self.config.numbers)), np.float32)
        self._at_rest[: len(self.slots_), :2] = self._statistics.means[self.slots_, ::-1]
        if self.config.sizes:
            size = [HABITS.index("width"), HABITS.index("height")]
            self._at_rest[: len(self.slots_), 2:4] = self.habits_[0][:, size]
        self._at_rest[:, :-1] /= IMAGE_SIZE_PX - 1


def sizes_px(tracks: Tracks) -> Floats:
    """Return width and height of each track, ``(n, 2)`` float32, in pixels of the 84×84 image."""
    return np.asarray(tracks.edges_px[:, 2:] - tracks.edges_px[:, :2], np.float32)


@compiled
def _write_slots(  # noqa: PLR0917 - compiled functions take no keywords
    vector: Floats,
    slots: Ints,
    roles: Ints,
    centres_px: Floats,
    sizes_px: Floats,
    time_since_update: Ints,
    last_px: int,
) -> None:
    """Write the tracks that have a role with a slot into ``(slots, 3)``, or ``(slots, 5)`` where sizes count."""
    for slot in range(len(slots)):
        for i in range(len(roles)):
            if roles[i] == slots[slot]:
                vector[slot, 0] = centres_px[i, 1] / np.float32(last_px)
                vector[slot, 1] = centres_px[i, 0] / np.float32(last_px)
                for axis in range(2, vector.shape[1] - 1):
                    vector[slot, axis] = sizes_px[i, axis - 2] / np.float32(last_px)
                vector[slot, -1] = time_since_update[i] == 0
