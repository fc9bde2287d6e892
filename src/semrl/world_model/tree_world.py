"""A model of the world made of trees, learned while the game goes on (§3.4.3)."""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from semrl.core import Floats, History, Ints, Scenarios, Trajectory
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.world_model.config import TreesConfig
from semrl.world_model.ensemble import GrownEnsemble
from semrl.world_model.experience import Experience
from semrl.world_model.rules import Rule, RuleBook, feature_names, read_tree
from semrl.world_model.switching import SwitchedOff
from semrl.world_model.tree_features import TreeFeatures
from semrl.world_model.trees import Forests

MAX_DIMENSION = 60
"""Longest state that trees are fitted to: twelve things with their sizes. They may look at all pairs of numbers."""
OLD_PER_NEW = 9
"""Remembered decisions to each new one that trees see which are grown anew in an altered world."""
REWARD, RETURN = "the reward", "the return"
"""What rules call them."""


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
    features : TreeFeatures
        What the trees see and are to predict.
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
        axes = np.zeros(dimension, np.int64) if axes is None else axes
        self.features = TreeFeatures(config, axes, discount=discount)
        self.forests = Forests(config.members)

    @property
    def experience(self) -> Experience:
        """The play that trees are grown from."""
        return self.memory

    def imagine(self, history: History, sequences: Ints) -> Scenarios:
        """Roll ``(s, t)`` sequences of actions forward from a moment; rewards and values are the forests' mean.

        Where some forests screen, only the sequences that they think best of come back.
        """
        unit = np.float32(self.config.resolution)
        features = self.features
        past = features.inertia_, *features.past(history)
        relations = features.relations_

        def roll(tried: Ints, members: slice) -> tuple[Floats, Floats, Floats]:
            return self.forests.roll(*past, tried, relations, members, features.ending_)

        imagined = self._imagined(roll, sequences)
        states = np.empty((*imagined.sequences.shape, history.states.shape[1]), np.float32)
        states[:] = history.states[0]
        states[:, :, features.varying_] = imagined.predicted * unit
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
        c, features = self.config, self.features
        varying = [names[i] for i in features.varying_.tolist()]
        columns = feature_names(varying, c.past_states, c.past_actions, features.relations_)
        scale = c.resolution / unit if unit else 1.0
        changing = [
            f"the change of {name}" if inert else name for name, inert in zip(varying, features.inertia_, strict=True)
        ]
        subjects = [*((name, scale) for name in changing), (REWARD, 1.0), (RETURN, 1.0)]
        trees = [
            read_tree(
                self.forests.tree(target), about, columns, actions, most=most, scale=scale, value_scale=value_scale
            )
            for target, (about, value_scale) in enumerate(subjects)
        ]
        return RuleBook(trees=tuple(trees), see=features.row)

    def switch_off(self, rules: Sequence[SwitchedOff]) -> None:
        """Let these rules count for nothing in what is imagined, and all others again."""
        self.forests.switch_off(rules)

    def learn_anew(self, play: Sequence[Trajectory], numbers: Collection[int], *, reward: bool) -> None:
        """Grow the trees of some numbers of a state, and of the reward, anew; a tenth of what they see is this play.

        The rest is drawn from what is remembered, where that was loaded. All other trees stay as they are; so does what
        is remembered, from which the next forest is grown again. Of numbers that never varied there are no trees.
        """
        features = self.features
        changed = [target for target, number in enumerate(features.varying_.tolist()) if number in numbers]
        changed += [len(features.varying_)] if reward else []
        if not changed:
            return
        new = Experience(sum(len(episode.states) for episode in play), len(features.axes))
        for episode in play:
            new.add(episode)
        rng = np.random.default_rng([self.seed, self.seen_, len(new)])
        rows, targets, _ = features.training_set(new, rng, settled=True)
        if len(self.experience):
            old_rows, old_targets, _ = features.training_set(self.experience, rng, settled=True)
            drawn = rng.choice(len(old_rows), min(OLD_PER_NEW * len(rows), len(old_rows)), replace=False)
            rows = np.concatenate([old_rows[drawn], rows])
            targets = np.concatenate([old_targets[drawn], targets])
        leaves = self.config.leaf_rows(targets.shape[1])
        fresh = Forests(self.config.members)
        fresh.fit(rows, targets[:, changed], rng, leaf_rows=[leaves[target] for target in changed])
        self.forests.take_over(fresh, changed)

    def to_arrays(self) -> Arrays:
        """Return trees and memory."""
        return self.inference_arrays() | nest(experience=self.experience.to_arrays())

    def inference_arrays(self) -> Arrays:
        """Return the trees alone."""
        counts = {"counts": np.array([self.seen_, *self.grown_])}
        return nest(forests=self.forests.to_arrays()) | self.features.to_arrays() | counts

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called; of the trees alone, predict as they did there."""
        if experience := unnest(arrays, "experience"):
            self.experience.from_arrays(experience)
        self.forests.from_arrays(unnest(arrays, "forests"))
        self.seen_, self.grown_ = int(arrays["counts"][0]), arrays["counts"][1:].copy()
        self.features.from_arrays(arrays)

    def _fewest_new(self, seen: int) -> float:
        c, features = self.config, self.features
        numbers = min(seen * features.columns, c.most_numbers) * (len(features.varying_) + 2)  # of each tree
        return numbers / c.grown_numbers if c.grown_numbers else 0.0

    def _prepared(self, memory: Experience, rng: np.random.Generator) -> tuple[Callable[[int | None], None], bool]:
        c, features = self.config, self.features
        before = features.settled
        rows, targets, other = features.training_set(memory, rng)
        leaves = c.leaf_rows(targets.shape[1])
        hidden_column = rows.shape[1] - 1 - c.past_actions  # the action

        def grow(member: int | None) -> None:
            self.forests.fit(
                rows, targets, rng, leaf_rows=leaves, hidden_column=hidden_column, member=member, other=other
            )

        return grow, all(np.array_equal(*pair) for pair in zip(before, features.settled, strict=True))
