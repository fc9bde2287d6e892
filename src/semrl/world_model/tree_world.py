"""A model of the world made of trees, learned while the game goes on (§3.4.3)."""

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, History, Ints, Scenarios, Trajectory
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.world_model.axes import NO_AXIS, is_place, things_of
from semrl.world_model.config import TreesConfig
from semrl.world_model.counterfactuals import Decisions, local_things, rearranged
from semrl.world_model.ensemble import GrownEnsemble
from semrl.world_model.experience import EVERY_REWARD, Experience
from semrl.world_model.nearest import nearest_of, none_compared
from semrl.world_model.rules import Rule, RuleBook, feature_names, read_tree
from semrl.world_model.switching import SwitchedOff
from semrl.world_model.tree_kernels import Relations, lay_out, width
from semrl.world_model.trees import Forests, OtherRows

MAX_DIMENSION = 60
"""Longest state that trees are fitted to: twelve things with their sizes. They may look at all pairs of numbers."""
OLD_PER_NEW = 9
"""Remembered decisions to each new one that trees see which are grown anew in an altered world."""
_UNDECIDED = 0.05  # share of the decisions: by so little nothing is decided anew, since all trees hang on it
REWARD, RETURN = "the reward", "the return"
"""What rules call them."""


class TrainingSet(NamedTuple):
    """What trees see of decisions, and are to predict."""

    rows: Floats
    """``(n, f)``."""
    targets: NDArray[np.float64]
    """``(n, k)``, changes, reward, return."""
    other: OtherRows | None
    """What those of local things learn from in place of it."""


class TreeWorld(GrownEnsemble[Experience]):
    """Regression trees for the change of each number of the state and for the reward.

    Parameters
    ----------
    config
        See `TreesConfig`.
    dimension
        Length of a state, at most 60.
    discount
        What a reward counts one decision later.
    seed
        Of the draws that the forests are grown from.
    axes
        ``(d,)`` int64: numbers of one axis have a distance, those of −1 none; all of them have when None.

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
    grown_ : ndarray
        ``(members,)`` int64, decisions after which each forest was grown; 0 before.

    Raises
    ------
    UsageError
        When states are too long for trees.
    """

    def __init__(
        self,
        config: TreesConfig,
        dimension: int,
        n_actions: int = 0,
        *,
        seed: int = 0,
        discount: float = 1.0,
        axes: Ints | None = None,
    ) -> None:
        del n_actions  # an action is a number among others to a tree
        if dimension > MAX_DIMENSION:
            raise UsageError(
                f"trees learn from states of at most {MAX_DIMENSION} numbers, not {dimension}; "
                "use planning.world_model = 'networks'"
            )
        super().__init__(config, Experience(config.capacity, dimension), seed=seed, discount=discount)
        self.config = config
        self.axes = np.zeros(dimension, np.int64) if axes is None else axes
        self.forests = Forests(config.members)
        self.varying_ = np.arange(dimension)
        self.steady_ = np.zeros(dimension, np.float32)
        self._compared = self.varying_, self._relations()  # which varied when these were compared
        self.inertia_ = np.zeros(dimension, np.float32)
        self.local_: Ints = np.zeros(0, np.int64)
        self.ending_ = EVERY_REWARD
        self._judged = 0

    @property
    def experience(self) -> Experience:
        """The play that trees are grown from."""
        return self.memory

    @property
    def relations_(self) -> Relations:
        """Which of the numbers that vary are compared, and how."""
        if self._compared[0] is not self.varying_:
            self._compared = self.varying_, self._relations()
        return self._compared[1]

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

    def imagine(self, history: History, sequences: Ints) -> Scenarios:
        """Roll ``(s, t)`` sequences of actions forward from a moment; rewards and values are the forests' mean.

        Where some forests screen, only the sequences that they think best of come back.
        """
        unit = np.float32(self.config.resolution)
        past = self.inertia_, *self._past(history)
        relations = self.relations_

        def roll(tried: Ints, members: slice) -> tuple[Floats, Floats, Floats]:
            return self.forests.roll(*past, tried, relations, members, self.ending_)

        imagined = self._imagined(roll, sequences)
        states = np.empty((*imagined.sequences.shape, history.states.shape[1]), np.float32)
        states[:] = history.states[0]
        states[:, :, self.varying_] = imagined.predicted * unit
        return imagined.scenarios(states)

    def rules(
        self, names: Sequence[str], actions: Sequence[str], *, most: int = 8, unit: float | None = None
    ) -> list[Rule]:
        """Say what the first forest has learned of each number, and of the reward, in so many rules each.

        Parameters
        ----------
        names
            Of the numbers of a state.
        actions
            Of the actions.
        most
            Rules for each.
        unit
            In which numbers are given; the resolution when None.
        """
        book = self.rule_book(names, actions, most=most, unit=unit)
        return [rule for rules in book.trees for rule in rules.by_support]

    def rule_book(
        self, names: Sequence[str], actions: Sequence[str], *, most: int = 8, unit: float | None = None
    ) -> RuleBook:
        """Return the same rules as a book that says which of them hold at a decision; see `rules`."""
        varying = [names[i] for i in self.varying_.tolist()]
        c = self.config
        columns = feature_names(varying, c.past_states, c.past_actions, self.relations_)
        scale = c.resolution / unit if unit else 1.0
        changing = [
            f"the change of {name}" if inert else name for name, inert in zip(varying, self.inertia_, strict=True)
        ]
        subjects = [*((name, scale) for name in changing), (REWARD, 1.0), (RETURN, 1.0)]
        trees = [
            read_tree(
                self.forests.tree(target), about, columns, actions, most=most, scale=scale, value_scale=value_scale
            )
            for target, (about, value_scale) in enumerate(subjects)
        ]
        return RuleBook(trees=tuple(trees), see=self._see)

    def switch_off(self, rules: Sequence[SwitchedOff]) -> None:
        """Let these rules count for nothing in what is imagined, and all others again."""
        self.forests.switch_off(rules)

    def _see(self, history: History, action: int) -> Floats:
        """Return what trees see of a decision, ``(f,)``."""
        window, before = self._past(history)
        rows = lay_out(window[None], before[None].astype(np.int64), np.array([action]), self.relations_)
        return np.asarray(rows[0])

    def _past(self, history: History) -> tuple[Floats, Floats]:
        """Return the states, in units of the resolution, and actions that are looked at, the newest first."""
        c = self.config
        return self._in_units(history.window(c.past_states)), history.recent(c.past_actions)

    def learn_anew(self, play: Sequence[Trajectory], numbers: Collection[int], *, reward: bool) -> None:
        """Grow the trees of some numbers of a state, and of the reward, anew; a tenth of what they see is this play.

        The rest is drawn from what is remembered, where that was loaded. All other trees stay as they are; so does what
        is remembered, from which the next forest is grown again.
        """
        new = Experience(sum(len(episode.states) for episode in play), len(self.axes))
        for episode in play:
            new.add(episode)
        changed = [target for target, number in enumerate(self.varying_.tolist()) if number in numbers]
        changed += [len(self.varying_)] if reward else []
        rng = np.random.default_rng([self.seed, self.seen_, len(new)])
        rows, targets, _ = self.training_set(new, rng, settled=True)
        if len(self.experience):
            old_rows, old_targets, _ = self.training_set(self.experience, rng, settled=True)
            drawn = rng.choice(len(old_rows), min(OLD_PER_NEW * len(rows), len(old_rows)), replace=False)
            rows = np.concatenate([old_rows[drawn], rows])
            targets = np.concatenate([old_targets[drawn], targets])
        leaves = self.config.leaf_rows(targets.shape[1])
        fresh = Forests(self.config.members)
        fresh.fit(rows, targets[:, changed], rng, leaf_rows=[leaves[target] for target in changed])
        self.forests.take_over(fresh, changed)

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
        most = max(c.most_numbers // self._columns, 1)
        if len(actions) > most:
            drawn = np.sort(rng.choice(len(actions), most, replace=False))
            play, signs, returns = play.take(drawn), signs[drawn], returns[drawn]
        rows, changes = self._lesson(play)
        targets = np.column_stack([changes, signs, returns]).astype(np.float64)
        return TrainingSet(rows, targets, self._local_lesson(play, rng) if len(self.local_) else None)

    def _settle(self, play: Decisions, rng: np.random.Generator) -> None:
        """Decide which numbers vary, which by themselves and, whenever play has doubled, which things are local."""
        states, inertia = play.states, np.zeros(len(self.axes), np.float32)
        inertia[self.varying_] = self.inertia_
        changed = (states[:, 0] != states[:, 1]).mean(axis=0)
        self.steady_ = np.rint(states[-1, 0] / np.float32(self.config.resolution))
        self.varying_ = np.flatnonzero((changed > 0) & (changed >= self.config.least_changes))
        changes, before = _changes(self._in_units(states))
        lead = (changes == before).mean(axis=0) - (changes == 0).mean(axis=0)
        self.inertia_ = np.where(np.abs(lead) < _UNDECIDED, inertia[self.varying_], lead > 0).astype(np.float32)
        begin = self.config.counterfactuals_from
        if begin and NO_AXIS in self.axes and len(states) >= max(begin, 2 * self._judged):
            self._judged = len(states)
            flying = self.varying_[(self.inertia_ > 0) & is_place(self.axes[self.varying_])]
            self.local_ = local_things(play, flying, self.axes, self._lesson_of, rng)

    def _in_units(self, states: Floats) -> Floats:
        """Return the numbers that vary of ``(…, d)`` states, in units of the resolution."""
        numbers: Floats = np.rint(states[..., self.varying_] / np.float32(self.config.resolution))
        return numbers

    def _lesson(self, play: Decisions) -> tuple[Floats, Floats]:
        """Return what trees see of decisions, ``(n, f)``, and by how much numbers change, ``(n, v)``."""
        numbers = self._in_units(play.states)
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

    def to_arrays(self) -> Arrays:
        """Return trees and memory."""
        return self.inference_arrays() | nest(experience=self.experience.to_arrays())

    def inference_arrays(self) -> Arrays:
        """Return the trees alone."""
        own = {
            "counts": np.array([self.seen_, *self.grown_]),
            "varying": self.varying_,
            "steady": self.steady_,
            "inertia": self.inertia_,
            "local": np.array([self._judged, *self.local_]),
            "ending": self.ending_,
            "columns": np.array(self._columns),
        }
        return nest(forests=self.forests.to_arrays()) | own

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called; of the trees alone, predict as they did there."""
        if experience := unnest(arrays, "experience"):
            self.experience.from_arrays(experience)
        self.forests.from_arrays(unnest(arrays, "forests"))
        self.varying_, self.inertia_ = arrays["varying"], arrays["inertia"]
        self.steady_ = arrays.get("steady", self.steady_)  # older checkpoints have none
        self._judged, *local = arrays.get("local", np.zeros(1, np.int64)).tolist()  # older checkpoints have none
        self.local_ = np.array(local, np.int64)
        self.ending_ = arrays.get("ending", EVERY_REWARD)
        self.seen_, self.grown_ = int(arrays["counts"][0]), arrays["counts"][1:].copy()
        if int(arrays["columns"]) != self._columns:
            raise ValueError(f"its trees look at {int(arrays['columns'])} numbers, not {self._columns}")

    @property
    def _columns(self) -> int:
        return int(width(len(self.varying_), self.config.past_states, self.config.past_actions, self.relations_))

    def _fewest_new(self, seen: int) -> float:
        c = self.config
        numbers = min(seen * self._columns, c.most_numbers) * (len(self.varying_) + 2)  # of each tree
        return numbers / c.grown_numbers if c.grown_numbers else 0.0

    @property
    def _settled(self) -> tuple[NDArray[Any], ...]:
        return self.varying_, self.inertia_, self.local_

    def _prepared(self, memory: Experience, rng: np.random.Generator) -> tuple[Callable[[int | None], None], bool]:
        c = self.config
        before = self._settled
        rows, targets, other = self.training_set(memory, rng)
        leaves = c.leaf_rows(targets.shape[1])
        hidden_column = rows.shape[1] - 1 - c.past_actions  # the action

        def grow(member: int | None) -> None:
            self.forests.fit(
                rows, targets, rng, leaf_rows=leaves, hidden_column=hidden_column, member=member, other=other
            )

        return grow, all(np.array_equal(*pair) for pair in zip(before, self._settled, strict=True))


def _changes(numbers: Floats) -> tuple[Floats, Floats]:
    """Return by how much ``(n, h, v)`` numbers change after the decision, and by how much they did before it."""
    return numbers[:, 0] - numbers[:, 1], numbers[:, 1] - numbers[:, 2]
