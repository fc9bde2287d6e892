"""Decisions that might have been: things that are far from all others change places with themselves at other times.

What flies by itself is moved by what is near. Trees do not know that, and take what goes together for what causes what.
In play that never was, but would have gone the same way, far things no longer go together ("Counterfactual Data
Augmentation using Locally Factored Dynamics", Pitis et al. 2020).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.world_model.axes import NO_AXIS, things_of
from semrl.world_model.trees import Forests

FAR = 0.2
"""Share of the image: things that are farther apart along an axis do not touch within a decision."""

JUDGED_DECISIONS = 5_000
"""The newest, in which it is judged which things are local: one half to learn from, the other to be tested in."""

_NEAR = 2.0  # units of the resolution: what is predicted so near is right
_WORSE = 0.03  # share of the decisions: by less it may be predicted worse from what is near alone
_FEWEST = 50  # decisions that it takes to judge

Mask = NDArray[np.bool_]
Places = dict[int, list[Ints]]


class Decisions(NamedTuple):
    """Decisions, and what was before and after them."""

    states: Floats
    """``(n, h, d)``: the state after each, the one in which it was taken, and those before, the newest first."""
    pasts: Ints
    """``(n, p)``, actions before, the newest first."""
    actions: Ints
    """``(n,)``."""

    def take(self, places: Ints | slice) -> "Decisions":
        """Return some of them."""
        return Decisions(self.states[places], self.pasts[places], self.actions[places])


Lesson = Callable[[Decisions, Ints], tuple[Floats, Floats]]
"""Returns what trees see of decisions, ``(n, f)``, and by how much some numbers change, ``(n, k)``."""


def local_things(play: Decisions, flying: Ints, axes: Ints, lesson: Lesson, rng: np.random.Generator) -> Ints:
    """Return the things that fly along both axes, and hardly worse predicted where far things have changed places.

    Something that follows another from afar is not among them.

    Parameters
    ----------
    play
        The newest last.
    flying
        Which numbers go on by themselves.
    axes
        See `StateSpace.axes`.
    lesson
        Lays out what is learned.
    rng
        Draws what changes places.
    """
    things = things_of(axes)
    both = [one for one in np.unique(things[flying]).tolist() if len(flying[things[flying] == one]) == 2]
    flying = flying[np.isin(things[flying], both)]
    play = play.take(slice(-JUDGED_DECISIONS, None))
    half = len(play.actions) // 2
    if half < _FEWEST or not len(flying):
        return np.zeros(0, np.int64)
    learned, new = play.take(slice(half)), play.take(slice(half, None))
    elsewhere = learned._replace(states=rearranged(learned.states, axes, rng))
    rows, came = lesson(new, flying)
    right = [np.abs(_predicted(lesson(one, flying), rows, rng) - came) <= _NEAR for one in (learned, elsewhere)]
    places = _places(new.states[:, 1], axes)
    alone = {one: _alone(new.states[:, 1], new.states[:, 1], one, places) for one in places}
    found = []
    for thing in filter(places.__contains__, both):
        seen = np.flatnonzero((things == thing) & (axes == NO_AXIS))
        known = alone[thing] & (new.states[:, :2, seen] > 0.5).all(axis=(1, 2))
        plain, apart = (one[known][:, things[flying] == thing].all(axis=1) for one in right)
        if known.sum() >= _FEWEST and apart.mean() >= plain.mean() - _WORSE:
            found.append(thing)
    return np.array(found, np.int64)


def _predicted(lesson: tuple[Floats, Floats], rows: Floats, rng: np.random.Generator) -> Floats:
    """Learn, and predict from other rows, ``(n, k)``."""
    seen, changes = lesson
    forest = Forests(1).fit(seen, changes.astype(np.float64), rng, leaf_rows=[2] * changes.shape[1])
    predicted: Floats = forest(rows)[0]
    return predicted


def rearranged(windows: Floats, axes: Ints, rng: np.random.Generator) -> Floats:
    """Give things that are far from all others what they had at another decision at which they were.

    Parameters
    ----------
    windows
        ``(n, h, d)``, the state after each decision, the one in which it was taken, and those before, the newest first.
    axes
        See `StateSpace.axes`.
    rng
        Draws the other decisions.
    """
    things = things_of(axes)
    now, windows = windows[:, 1], windows.copy()
    places = _places(now, axes)
    alone = {one: _alone(now, now, one, places) for one in places}
    for one in places:
        mine = np.flatnonzero(things == one)
        lot = rng.permutation(len(now))
        free = alone[one] & alone[one][lot] & _alone(now[lot], windows[:, 1], one, places)
        had = windows[:, :, mine]
        windows[:, :, mine] = np.where(free[:, None, None], had[lot], had)
    return windows


def _places(states: Floats, axes: Ints) -> Places:
    """Return for each thing that is not the same in all ``(n, d)`` states which number is its x, and which its y."""
    things = things_of(axes)
    lively = np.unique(things[(states != states[0]).any(axis=0)])
    return {one: [np.flatnonzero((things == one) & (axes == axis))[:1] for axis in range(2)] for one in lively.tolist()}


def _alone(own: Floats, others: Floats, thing: int, places: Places) -> Mask:
    """Tell where a thing, as it is in ``(n, d)`` states, is far from all other things as they are in others."""
    alone = np.ones(len(own), np.bool_)
    for other in places.keys() - {thing}:
        apart = np.zeros(len(own), np.bool_)
        for mine, theirs in zip(places[thing], places[other], strict=True):
            if len(mine) and len(theirs):
                apart |= np.abs(own[:, mine[0]] - others[:, theirs[0]]) > FAR
        alone &= apart
    return alone
