"""What trees see of play, and what they are to predict of it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, History, Ints
from semrl.core.arrays import Arrays
from semrl.world_model.axes import NO_AXIS, is_place, things_of
from semrl.world_model.config import TreesConfig
from semrl.world_model.counterfactuals import Decisions, local_things, rearranged
from semrl.world_model.experience import EVERY_REWARD, Experience
from semrl.world_model.nearest import nearest_of, none_compared
from semrl.world_model.tree_kernels import Relations, lay_out, width
from semrl.world_model.trees import OtherRows

_UNDECIDED = 0.05  # share of the decisions: by so little nothing is decided anew, since all trees hang on it


class TrainingSet(NamedTuple):
    """What trees see of decisions, and are to predict."""

    rows: Floats
    """``(n, f)``."""
    targets: NDArray[np.float64]
    """``(n, k)``, changes, reward, return."""
    other: OtherRows | None
    """What those of local things learn from in place of it."""


class TreeFeatures:
    """Which numbers of a state trees look at, in which relations, and which of them go on by themselves.

    Parameters
    ----------
    config
        See `TreesConfig`.
    axes
        See `StateSpace.axes`.
    discount
        What a reward counts one decision later.

    Attributes
    ----------
    varying_ : ndarray
        ``(k,)`` int64, the numbers of a state that are looked at: those that change.
    steady_ : ndarray
        ``(d,)`` float32, what the newest state was when that was decided, in units of the resolution.
    inertia_ : ndarray
        ``(k,)`` float32, 1 for those of them that mostly change as they just did, like a ball in flight: of these the
        trees predict how the change changes. 0 for the others.
    local_ : ndarray
        ``(m,)`` int64, things (`things_of`) that are predicted as well from what is near alone.
    ending_ : ndarray
        ``(2,)`` bool, whether a loss and whether a gain ends what is imagined.
    """

    def __init__(self, config: TreesConfig, axes: Ints, *, discount: float) -> None:
        dimension = len(axes)
        self.config = config
        self.axes = axes
        self.discount = discount
        self.varying_ = np.arange(dimension)
        self.steady_ = np.zeros(dimension, np.float32)
        self._compared = self.varying_, self._relations()  # which varied when these were compared
        self.inertia_ = np.zeros(dimension, np.float32)
        self.local_: Ints = np.zeros(0, np.int64)
        self.ending_ = EVERY_REWARD
        self._judged = 0

    @property
    def relations_(self) -> Relations:
        """Which of the numbers that vary are compared, and how."""
        if self._compared[0] is not self.varying_:
            self._compared = self.varying_, self._relations()
        return self._compared[1]

    @property
    def columns(self) -> int:
        """How many numbers trees see of a decision."""
        return int(width(len(self.varying_), self.config.past_states, self.config.past_actions, self.relations_))

    @property
    def settled(self) -> tuple[NDArray[Any], ...]:
        """What trees hang on: where any of it changes, all of them must be grown anew."""
        return self.varying_, self.inertia_, self.local_

    def row(self, history: History, action: int) -> Floats:
        """Return what trees see of a decision, ``(f,)``."""
        window, before = self.past(history)
        rows = lay_out(window[None], before[None].astype(np.int64), np.array([action]), self.relations_)
        return np.asarray(rows[0])

    def past(self, history: History) -> tuple[Floats, Floats]:
        """Return the states, in units of the resolution, and actions that are looked at, the newest first."""
        c = self.config
        return self.in_units(history.window(c.past_states)), history.recent(c.past_actions)

    def in_units(self, states: Floats) -> Floats:
        """Return the numbers that vary of ``(…, d)`` states, in units of the resolution."""
        numbers: Floats = np.rint(states[..., self.varying_] / np.float32(self.config.resolution))
        return numbers

    def training_set(self, buffer: Experience, rng: np.random.Generator, *, settled: bool = False) -> TrainingSet:
        """Return what trees see of decisions and are to predict: changes, reward, return.

        Unless that is settled, it decides which numbers vary, which of them by themselves, and which things are local;
        numbers that hardly ever change are left out. Of too many decisions some are drawn.
        """
        c = self.config
        windows, pasts, actions, rewards, following = buffer.windows(c.past_states, c.past_actions)
        play = Decisions(np.concatenate([following[:, None], windows], axis=1), pasts, actions)
        if not settled:
            self._settle(play, rng)
            self.ending_ = buffer.ending(c.reward_gap)
        signs = np.sign(rewards)
        returns = buffer.returns(self.discount) if c.value_leaf_decisions else np.zeros_like(signs)
        most = max(c.most_numbers // self.columns, 1)
        if len(actions) > most:
            drawn = np.sort(rng.choice(len(actions), most, replace=False))
            play, signs, returns = play.take(drawn), signs[drawn], returns[drawn]
        rows, changes = self._lesson(play)
        targets = np.column_stack([changes, signs, returns]).astype(np.float64)
        return TrainingSet(rows, targets, self._local_lesson(play, rng) if len(self.local_) else None)

    def to_arrays(self) -> Arrays:
        """Return what was decided."""
        return {
            "varying": self.varying_,
            "steady": self.steady_,
            "inertia": self.inertia_,
            "local": np.array([self._judged, *self.local_]),
            "ending": self.ending_,
            "columns": np.array(self.columns),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned.

        Raises
        ------
        ValueError
            When these trees would see another number of numbers.
        """
        self.varying_, self.inertia_ = arrays["varying"], arrays["inertia"]
        self.steady_ = arrays.get("steady", self.steady_)  # older checkpoints have none
        self._judged, *local = arrays.get("local", np.zeros(1, np.int64)).tolist()  # older checkpoints have none
        self.local_ = np.array(local, np.int64)
        self.ending_ = arrays.get("ending", EVERY_REWARD)
        if int(arrays["columns"]) != self.columns:
            raise ValueError(f"its trees look at {int(arrays['columns'])} numbers, not {self.columns}")

    def _settle(self, play: Decisions, rng: np.random.Generator) -> None:
        """Decide which numbers vary, which by themselves and, whenever play has doubled, which things are local."""
        states, inertia = play.states, np.zeros(len(self.axes), np.float32)
        inertia[self.varying_] = self.inertia_
        changed = (states[:, 0] != states[:, 1]).mean(axis=0)
        self.steady_ = np.rint(states[-1, 0] / np.float32(self.config.resolution))
        self.varying_ = np.flatnonzero((changed > 0) & (changed >= self.config.least_changes))
        changes, before = _changes(self.in_units(states))
        lead = (changes == before).mean(axis=0) - (changes == 0).mean(axis=0)
        self.inertia_ = np.where(np.abs(lead) < _UNDECIDED, inertia[self.varying_], lead > 0).astype(np.float32)
        begin = self.config.counterfactuals_from
        if begin and NO_AXIS in self.axes and len(states) >= max(begin, 2 * self._judged):
            self._judged = len(states)
            flying = self.varying_[(self.inertia_ > 0) & is_place(self.axes[self.varying_])]
            self.local_ = local_things(play, flying, self.axes, self._lesson_of, rng)

    def _lesson(self, play: Decisions) -> tuple[Floats, Floats]:
        """Return what trees see of decisions, ``(n, f)``, and by how much numbers change, ``(n, v)``."""
        numbers = self.in_units(play.states)
        changes, before = _changes(numbers)
        rows = lay_out(numbers[:, 1:], play.pasts, play.actions, self.relations_)
        return rows, changes - self.inertia_ * before

    def _lesson_of(self, play: Decisions, numbers: Ints) -> tuple[Floats, Floats]:
        """Return the same for some of the numbers alone."""
        rows, changes = self._lesson(play)
        return rows, changes[:, np.searchsorted(self.varying_, numbers)]

    def _local_lesson(self, play: Decisions, rng: np.random.Generator) -> OtherRows:
        """Return what trees of local things see: far things have changed places."""
        mine = np.isin(things_of(self.axes), self.local_) & (self.axes != NO_AXIS)
        columns = np.flatnonzero(mine[self.varying_])
        states = rearranged(play.states, self.axes, rng)
        rows, changes = self._lesson(Decisions(states, play.pasts, play.actions))
        return OtherRows(columns.tolist(), rows, changes[:, columns].astype(np.float64))

    def _relations(self) -> Relations:
        c = self.config
        nearest = nearest_of(self.axes, self.varying_, self.steady_, c.resolution)
        if 0 < c.nearest_from <= len(nearest.columns):
            return Relations(np.zeros((0, 2), np.int64), c.distances, nearest)
        return Relations(self._pairs(), c.distances, none_compared())

    def _pairs(self) -> Ints:
        axes = self.axes[self.varying_]
        alone = np.ones((len(axes),) * 2, np.bool_)
        if self.config.distances:
            alone = (axes[:, None] == axes) & is_place(axes)
        return np.argwhere(np.triu(alone, 1))


def _changes(numbers: Floats) -> tuple[Floats, Floats]:
    """Return by how much ``(n, h, v)`` numbers change after the decision, and by how much they did before it."""
    return numbers[:, 0] - numbers[:, 1], numbers[:, 1] - numbers[:, 2]
