"""What looks like nothing that is known, but behaves like it: it is taken for that, and has its slot and its rules."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, Tracks
from semrl.core.errors import UsageError
from semrl.core.protocols import Saved
from semrl.core.things import LEAST_MOVING_SHARE
from semrl.perception.tracking.slot_statistics import HABITS, habits_of
from semrl.perception.tracking.slots import SlotAssigner
from semrl.perception.tracking.tints import ALIKE

N_BEHAVIOUR = HABITS.index("red")
"""The first so many habits are behaviour: where it stays, how large it is, how it moves. The others are its colour."""

MOST_LOOKS = 64
"""Of an episode; more are not told apart from what is known."""

_LEAST_DEVIATION_PX = 0.5
"""What is as regular as that cannot be told from what is more so."""


@dataclass(frozen=True, kw_only=True)
class InheritanceConfig:
    """When something that looks new is taken for something known."""

    decisions: int = 8
    """Decisions at which a look that was not met while slots were learned must have been seen to move, before it is
    taken for what behaves most like it; 0: never."""
    fit: float = 4.0
    """How far it may be from what it is taken for: the mean square of its deviations, in standard deviations."""
    shares: bool = True
    """Whether, where more things of a kind are seen at once than while slots were learned, plans are made for all."""

    def __post_init__(self) -> None:
        if self.decisions < 0 or not self.fit > 0:
            given = f"not {self.decisions} and {self.fit}"
            raise UsageError(f"inheritance.decisions must be 0 or more and inheritance.fit above 0, {given}")


class Inheritance(Saved):
    """What the new looks of an episode are taken for.

    A look is a class in a colour. One that was never met while slots were learned says nothing by itself: the
    clusterer gives it the nearest class, which may be that of something else. How it behaves is compared with the
    habits of each slot, as normal distributions that are independent of each other (naive Bayes), at every decision at
    which it is seen to move. From then on it has the class and the colour of what it is likest, and all that goes by
    them: role and slot, kind and concept, and the rules about these. What is known is never looked at.

    Parameters
    ----------
    assigner
        Knows the habits of what has a slot.
    config
        See `InheritanceConfig`.
    """

    SAVED = ("_decisions", "_classes", "_colours", "_counts", "_sums", "_slots", "_since")

    def __init__(self, assigner: SlotAssigner, config: InheritanceConfig) -> None:
        self.config = config
        self._assigner = assigner
        means, variances = assigner.habits_
        self._kinds, self._looks = assigner.kinds_[assigner.slots_], assigner.colours_
        self._means = means[:, :N_BEHAVIOUR]
        self._variances = variances[:, :N_BEHAVIOUR] + _LEAST_DEVIATION_PX**2
        self._on = config.decisions > 0 and means.any(axis=1).all() and len(means) > 0
        self._decisions = 0
        self._classes: Ints = np.zeros(0, np.int64)  # of each look
        self._colours: Floats = np.zeros((0, 3), np.float32)
        self._counts: Ints = np.zeros(0, np.int64)  # sightings of each
        self._sums: NDArray[np.float64] = np.zeros((0, len(means), 2))  # squared deviations, and log-likelihoods
        self._slots: Ints = np.zeros(0, np.int64)  # for which each is taken, −1: for none
        self._since: Ints = np.zeros(0, np.int64)

    def as_known(self, tracks: Tracks) -> Tracks:
        """Return the tracks of the next decision, what is new with class and colour of what it is taken for."""
        if not self._on:
            return tracks
        self._decisions += 1
        new = np.flatnonzero(self._assigner.is_new(tracks))
        if not len(new):
            return tracks
        looks = self._looks_of(tracks, new)
        moving = tracks.visible & (tracks.ages > 0) & (tracks.moves >= LEAST_MOVING_SHARE * tracks.ages)
        weighed = moving[new] & (looks >= 0)
        self._weigh(habits_of(tracks)[new[weighed], :N_BEHAVIOUR], looks[weighed])
        self._decide()
        slots = np.where(looks >= 0, np.append(self._slots, -1)[looks], -1)
        taken, slots = new[slots >= 0], slots[slots >= 0]
        classes, colours = tracks.classes.copy(), tracks.colours.copy()
        classes[taken], colours[taken] = self._kinds[slots], self._looks[slots]
        return replace(tracks, classes=classes, colours=colours)

    def remarks(self) -> tuple[str, ...]:
        """Say what is taken for what, and since when."""
        names = self._assigner.names_
        return tuple(
            f"class {self._classes[i]} in the colour {_hexadecimal(self._colours[i])} is taken for {names[slot]} "
            f"since decision {self._since[i]}"
            for i, slot in enumerate(self._slots.tolist())
            if slot >= 0
        )

    def _looks_of(self, tracks: Tracks, new: Ints) -> Ints:
        """Return the number of the look of each new track, ``(n,)``; −1 where there are too many."""
        looks = np.full(len(new), -1)
        for i, track in enumerate(new.tolist()):
            number, colour = tracks.classes[track], tracks.colours[track]
            same = (self._classes == number) & (np.abs(self._colours - colour).max(axis=1, initial=0) <= ALIKE)
            if same.any():
                looks[i] = same.argmax()
            elif len(self._classes) < MOST_LOOKS:
                looks[i] = len(self._classes)
                self._classes = np.append(self._classes, number)
                self._colours = np.concatenate([self._colours, colour[None]])
                self._counts, self._since = np.append(self._counts, 0), np.append(self._since, 0)
                self._slots = np.append(self._slots, -1)
                self._sums = np.pad(self._sums, ((0, 1), (0, 0), (0, 0)))
        return looks

    def _weigh(self, habits: NDArray[np.float64], looks: Ints) -> None:
        """Compare what is seen, ``(n, 6)``, with the habits of each slot."""
        squares = np.square(habits[:, None] - self._means) / self._variances  # (n, k, 6)
        likely = -0.5 * (squares + np.log(self._variances)).sum(axis=2)
        np.add.at(self._sums, looks, np.stack([squares.mean(axis=2), likely], axis=2))
        np.add.at(self._counts, looks, 1)

    def _decide(self) -> None:
        """Take each look that was seen often enough for what it is likest, if it is like that at all."""
        far, likely = np.moveaxis(self._sums / np.maximum(self._counts, 1)[:, None, None], 2, 0)
        best = likely.argmax(axis=1)
        fits = (self._counts >= self.config.decisions) & (far[np.arange(len(best)), best] <= self.config.fit)
        slots = np.where(fits, best, -1)
        self._since = np.where(slots == self._slots, self._since, self._decisions - 1)
        self._slots = slots


def _hexadecimal(colour: Floats) -> str:
    return "#" + "".join(f"{round(float(part)):02x}" for part in colour)
