"""Which kinds are one concept, learned from play: what switches into one another and is not seen together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semrl.concepts.counting import GROUND_WAY, LABELS_A_KIND, STEP_PX, Counts, count, no_counts, widened
from semrl.core import ConceptTable, Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.errors import UsageError
from semrl.core.things import KIND, MAX_SLOTS, no_things

NO_CONCEPT = -1
"""Of what was seen too rarely."""

_OUTLIERS = 0.01
"""Share of the places of a concept beyond each of its bounds: some are mistakes."""

_SAME_PX = 0.3

_MEASURES = 6, 841  # see Counts.measures

Group = list[int]
"""Labels of one concept."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ConceptsConfig:
    """When kinds are one concept."""

    merge_share: float = 0.4
    """Share of the comings and goings of a kind that must be switches with another, to be one with it."""
    least_switches: int = 4
    """Fewest switches between two kinds that count."""
    together_share: float = 0.2
    """Pairs of both that are seen at once, as a share of the rarer one's sightings, from which on two kinds are not one
    concept."""
    least_seen: int = 20
    """Fewest sightings of a concept."""
    rare_share: float = 0.002
    """What is seen at a smaller share of the decisions is no concept."""
    least_touches: int = 3
    """Fewest touches from which it is decided whether the ground blocks, or is lost when it is touched."""

    def __post_init__(self) -> None:
        for name in ("merge_share", "together_share", "rare_share"):
            if not 0 <= getattr(self, name) <= 1:
                raise UsageError(f"concepts.{name} must lie in 0 … 1, not {getattr(self, name)}")
        if min(self.least_switches, self.least_seen, self.least_touches) < 1:
            raise UsageError("concepts.least_switches, least_seen and least_touches must be 1 or more")


class Concepts:
    """Concepts of things, their taxonomy and what is typical of them.

    A thing's *label* is its class (§3.2.2) together with whether it stays where it is and whether actions move it.
    Labels of one way of moving become one concept when tracks switch between them: a paddle looks another way where the
    edge of the arena hides a part of it. A number stays with its concept while more is learned. Each colour of the
    ground is a concept too; what comes of touching it decides whether it matters.

    Parameters
    ----------
    config
        See `ConceptsConfig`.

    Attributes
    ----------
    decisions_ : int
        Decisions counted so far.
    number_of_ : ndarray
        ``(l,)`` int64, the concept of each label, −1 for none; see `semrl.concepts.counting`.
    families_ : ndarray
        ``(c,)`` int64: concepts that look alike, whether actions move them or not, are of one family; of the ground,
        what is lost when it is touched, and what blocks.
    blocks_, is_lost_ : ndarray
        ``(c,)`` bool: ground that mostly stops what touches it, and of which a piece is mostly gone then.
    sizes_px_ : ndarray
        ``(c, 2)`` float32, commonest width and height.
    bounds_px_ : ndarray
        ``(c, 4)`` float32: least left and top, largest right and bottom, but for one in a hundred.

    Examples
    --------
    >>> ball, paddle = [0, 7, 0, 0, 1, 10, 10, 12, 12], [1, 3, 0, 1, 0, 70, 30, 72, 40]
    >>> play = [np.array([ball, paddle], np.float32)] * 20
    >>> concepts = Concepts().partial_fit(play)
    >>> concepts.table_.names
    ('own', 'object1')
    """

    def __init__(self, config: ConceptsConfig | None = None) -> None:
        self.config = config or ConceptsConfig()
        self.decisions_ = 0
        self._counts: Counts = no_counts(0)
        self._settle(np.zeros(0, np.int64), 0)

    @property
    def is_fitted(self) -> bool:
        """Whether any concept is known."""
        return bool((self.number_of_ >= 0).any())

    def __len__(self) -> int:
        """How many numbers were given to concepts so far."""
        return self._numbers

    @property
    def table_(self) -> ConceptTable:
        """The concepts, by number; one that became part of another has no kinds any more."""
        names = tuple(self._name(number) for number in range(self._numbers))
        kinds = tuple(tuple(sorted({label // LABELS_A_KIND for label in group})) for group in self._groups)
        return ConceptTable(
            names=names, controlled=self.controlled_, static=self.static_, kinds=kinds, arena_px=self.arena_px_
        )

    def _name(self, number: int) -> str:
        """Return what a concept is called: as the slot that is its own, if it has one, is called in the facts."""
        if self.static_[number]:
            return f"still{number}"
        slots = np.flatnonzero(self._in_slots == number)
        if not self.controlled_[number]:
            return f"object{slots[0]}" if len(slots) == 1 else f"concept{number}"
        steered = np.isin(self._in_slots, np.flatnonzero(self.controlled_)).sum()
        if (self.controlled_ & self._used).sum() == 1 or len(slots) == steered == 1:
            return "own"
        return f"own{slots[0]}" if len(slots) == 1 else f"concept{number}"

    @property
    def arena_px_(self) -> Floats:
        """Left, top, right and bottom of where things move, ``(4,)`` float32; else the whole image."""
        moving = self.bounds_px_[~self.static_ & self._used]
        if not len(moving):
            return np.array([0, 0, 84, 84], np.float32)
        return np.concatenate([moving[:, :2].min(axis=0), moving[:, 2:].max(axis=0)])

    def partial_fit(self, things: Sequence[Floats]) -> Self:
        """Learn from an episode: the things of each of its decisions, ``(n, 9)``, see `semrl.core.things`."""
        rows = np.concatenate([no_things(), *things])
        kinds = int(rows[:, KIND].max(initial=-1)) + 1
        if kinds * LABELS_A_KIND > len(self._counts.seen):
            self._counts = widened(self._counts, kinds * LABELS_A_KIND)
        count(rows, np.cumsum([len(part) for part in things], dtype=np.int64), self._counts)
        self.decisions_ += len(things)
        self._settle(*self._numbered(self._merged()))
        return self

    def to_arrays(self) -> Arrays:
        """Return what was counted, and the numbers that were given."""
        own = {"decisions": np.array(self.decisions_), "numbers": np.array(self._numbers)}
        return {**self._counts._asdict(), **own, "number_of": self.number_of_.copy()}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        known = no_counts(len(arrays["seen"]))._asdict() | arrays  # older checkpoints counted less
        counts = Counts(*(known[name].copy() for name in Counts._fields))
        self._counts, self.decisions_ = counts, int(arrays["decisions"])
        self._settle(arrays["number_of"].copy(), int(arrays["numbers"]))

    def _merged(self) -> list[Group]:
        """Put labels together, those first that switch most into one another."""
        n, labels = self._counts, np.flatnonzero(self._counts.seen)
        groups = [[int(label)] for label in labels]
        ways = labels % LABELS_A_KIND
        follows, together = n.follows[np.ix_(labels, labels)], n.together[np.ix_(labels, labels)]
        totals = np.column_stack([n.seen, n.begins + n.ends])[labels]
        while len(groups) > 1:
            shares = np.where(ways[:, None] == ways, self._shares(follows, together, totals), 0)
            i, j = divmod(int(shares.argmax()), len(groups))
            if shares[i, j] <= self.config.merge_share:
                break
            groups[i] += groups[j]
            del groups[j]
            for table in (follows, together):
                table[i] += table[j]
                table[:, i] += table[:, j]
            totals[i] += totals[j]
            follows, together = (np.delete(np.delete(table, j, 0), j, 1) for table in (follows, together))
            totals, ways = np.delete(totals, j, 0), np.delete(ways, j)
        rare = max(self.config.rare_share * self.decisions_, self.config.least_seen)
        return [group for group in groups if n.seen[group].sum() >= rare]

    def _shares(self, follows: Ints, together: Ints, totals: Ints) -> NDArray[np.float64]:
        """Return which share of the comings and goings of each group (columns) are switches with each other (rows)."""
        c, seen = self.config, totals[:, 0]
        switches = follows + follows.T
        turns = switches.sum(axis=0) - np.diag(switches) + totals[:, 1]
        fewer = np.minimum(seen[:, None], seen)
        enough = (switches >= np.maximum(c.least_switches, 0.01 * fewer)) & (together < c.together_share * fewer)
        np.fill_diagonal(enough, False)
        return np.where(enough, switches / np.maximum(turns, 1), 0.0)

    def _numbered(self, groups: list[Group]) -> tuple[Ints, int]:
        """Give each group the number that most of it had before, or a new one; return those of labels, and how many."""
        seen, before = self._counts.seen, np.full(len(self._counts.seen), NO_CONCEPT)
        before[: len(self.number_of_)] = self.number_of_
        numbers, given = np.full(len(seen), NO_CONCEPT), self._numbers
        taken: set[int] = set()
        for group in sorted(groups, key=lambda one: -seen[one].sum()):
            known = [label for label in group if before[label] >= 0 and int(before[label]) not in taken]
            if known:
                number = int(before[max(known, key=lambda label: seen[label])])
            else:
                number, given = given, given + 1
            taken.add(number)
            numbers[group] = number
        return numbers, given

    def _settle(self, number_of: Ints, numbers: int) -> None:
        """Take over which label is of which concept, and derive what follows."""
        self.number_of_, self._numbers = number_of, numbers
        n = self._counts
        self._groups = [np.flatnonzero(number_of == number).tolist() for number in range(numbers)]
        self._used = np.array([bool(group) for group in self._groups], np.bool_)
        flags = np.array([group[0] % LABELS_A_KIND if group else 0 for group in self._groups], np.int64)
        self.static_: NDArray[np.bool_] = flags >= 2
        self.controlled_: NDArray[np.bool_] = flags == 1
        self._ground: NDArray[np.bool_] = flags == GROUND_WAY
        in_slots = np.array([n.slots[group].sum(axis=0) for group in self._groups]).reshape(numbers, MAX_SLOTS)
        met = in_slots.any(axis=0)
        self._in_slots = np.where(met, in_slots.argmax(axis=0), NO_CONCEPT) if numbers else np.zeros(0, np.int64)
        measured = np.array([n.measures[group].sum(axis=0) for group in self._groups]).reshape(numbers, *_MEASURES)
        self.sizes_px_: Floats = (measured[:, 4:].argmax(axis=2) * STEP_PX).astype(np.float32)
        self.bounds_px_: Floats = np.concatenate(
            [_quantile(measured[:, :2], _OUTLIERS), _quantile(measured[:, 2:4], 1 - _OUTLIERS)], axis=1
        )
        self.blocks_, self.is_lost_ = self._uses()
        self.families_ = self._alike()

    def _uses(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Tell which ground blocks, and which is lost when it is touched.

        What was hardly touched yet is taken for what is as thick and most nearly as long: bricks of another colour.
        """
        touches = np.array([self._counts.touches[group].sum(axis=0) for group in self._groups]).reshape(-1, 3)
        thick = self.sizes_px_.min(axis=1)
        often = self._ground & (touches[:, 0] >= self.config.least_touches)
        blocks, is_lost = (often & (2 * touches[:, k] >= touches[:, 0]) for k in (1, 2))
        for number in np.flatnonzero(self._ground & ~often):
            same = often & (np.abs(thick - thick[number]) <= _SAME_PX)
            if same.any():
                lengths = self.sizes_px_.max(axis=1)
                alike = int(np.where(same, np.abs(lengths - lengths[number]), np.inf).argmin())
                blocks[number], is_lost[number] = blocks[alike], is_lost[alike]
        return blocks, is_lost

    def _alike(self) -> Ints:
        """Number the families: what moves, or stays, alike and looks alike half of the time; ground by its use."""
        looks = np.zeros((self._numbers, len(self.number_of_) // LABELS_A_KIND + 1))
        for number, group in enumerate(self._groups):
            for label in group:
                looks[number, label // LABELS_A_KIND] += self._counts.seen[label]
        looks /= np.maximum(looks.sum(axis=1, keepdims=True), 1)
        families = np.arange(self._numbers)
        for i in range(self._numbers):
            for j in range(i):
                if self._ground[i] or self._ground[j]:
                    alike = self._used_alike(i, j)
                else:
                    alike = self.static_[i] == self.static_[j] and np.minimum(looks[i], looks[j]).sum() >= 0.5
                if alike:
                    families[i] = families[j]
                    break
        return families

    def _used_alike(self, i: int, j: int) -> bool:
        """Tell whether two concepts are ground that is lost when it is touched, or that blocks and stays."""
        if not (self._ground[i] and self._ground[j]):
            return False
        lost, blocks = self.is_lost_[[i, j]], self.blocks_[[i, j]]
        return bool(lost.all() or (blocks.all() and not lost.any()))


def _quantile(counted: NDArray[np.int32], share: float) -> Floats:
    """Return the places below which this share of what was counted lies, ``(c, 2)``, in pixels."""
    sums = counted.cumsum(axis=2)
    places: Floats = ((sums < share * sums[:, :, -1:]).sum(axis=2) * STEP_PX).astype(np.float32)
    return places
