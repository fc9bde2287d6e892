"""What is counted of tracks: which labels follow each other, begin, end and are seen together; compiled.

A *label* is what a thing looks like and how it behaves: class number, whether it stays where it is, whether actions
move it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.concepts.touching import count_touches
from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.core.things import GROUND, ID, KIND, LEFT, MAX_SLOTS, OWN, SLOT, STILL

LABELS_A_KIND = 4
"""A kind that moves, by itself or by actions, or stays; and a colour of the background."""

GROUND_WAY = 3
"""What is left of a label of the ground when it is divided by this many."""

STEP_PX = 0.1
_STEPS = 841  # the whole image


class Counts(NamedTuple):
    """What was counted of each of l labels."""

    seen: Ints
    """``(l,)`` int64, things."""
    follows: Ints
    """``(l, l)`` int64: how often a thing of the one label had the other at the next decision, where there was then one
    more of the other and one fewer of the one: else two tracks were mixed up."""
    begins: Ints
    ends: Ints
    """``(l,)`` int64: how often a thing came or went, and there was one more, or one fewer, of its label."""
    together: Ints
    """``(l, l)`` int64: pairs of things of both that were seen at one decision."""
    measures: NDArray[np.int32]
    """``(l, 6, 841)`` int32: things of each left, top, right, bottom, width and height, in tenths of a pixel."""
    touches: NDArray[np.int64]
    """``(l, 3)`` int64, of labels of the ground: how often it was touched, stopped what did, was lost then."""
    slots: Ints
    """``(l, 64)`` int64: things of each in each place of the list of tracked objects."""


def no_counts(labels: int) -> Counts:
    """Return the counts of so many labels before anything was seen."""
    one, two = np.zeros(labels, np.int64), np.zeros((labels, labels), np.int64)
    measures = np.zeros((labels, 6, _STEPS), np.int32)
    touches, slots = np.zeros((labels, 3), np.int64), np.zeros((labels, MAX_SLOTS), np.int64)
    return Counts(one, two, one.copy(), one.copy(), two.copy(), measures, touches, slots)


def widened(counts: Counts, labels: int) -> Counts:
    """Return the same counts with room for more labels."""
    new, k = no_counts(labels), len(counts.seen)
    for name in ("seen", "begins", "ends", "measures", "touches", "slots"):
        getattr(new, name)[:k] = getattr(counts, name)
    new.follows[:k, :k], new.together[:k, :k] = counts.follows, counts.together
    return new


@compiled
def labels_of(things: Floats) -> Ints:
    """Return the label of each of ``(n, 9)`` things, ``(n,)`` int64."""
    labels = np.empty(len(things), np.int64)
    for i in range(len(things)):
        way = 3 if things[i, STILL] == GROUND else int(things[i, STILL]) * 2 + int(things[i, OWN])
        labels[i] = int(things[i, KIND]) * 4 + way
    return labels


@compiled
def count(things: Floats, ends: Ints, counts: Counts) -> None:
    """Count an episode, in place: ``(n, 9)`` things, those of each decision behind each other, up to its end."""
    labels = labels_of(things)
    count_touches(things, labels, ends, counts.touches)
    n = len(counts.seen)
    before, now = np.zeros(n, np.int64), np.zeros(n, np.int64)
    old_begin, begin = int(np.int64(0)), int(np.int64(0))  # typed, or what is called is compiled for each literal
    for t in range(len(ends)):
        end = ends[t]
        now[:] = 0
        for i in range(begin, end):
            now[labels[i]] += 1
            _measure(things[i], labels[i], counts)
        for i in range(begin, end):
            for j in range(begin, i):
                counts.together[labels[i], labels[j]] += 1
                counts.together[labels[j], labels[i]] += 1
        if t:
            _compare(things, labels, (old_begin, begin, end), (before, now), counts)
        before[:] = now
        old_begin, begin = begin, end


@compiled
def _measure(thing: Floats, label: int, counts: Counts) -> None:
    """Count one thing, its slot, where its edges are and how large it is."""
    counts.seen[label] += 1
    if thing[SLOT] >= 0:
        counts.slots[label, int(thing[SLOT])] += 1
    last = counts.measures.shape[2] - 1
    for k in range(6):
        value = thing[LEFT + k] if k < 4 else thing[LEFT + k - 2] - thing[LEFT + k - 4]
        counts.measures[label, k, min(max(int(np.rint(value / STEP_PX)), 0), last)] += 1


@compiled
def _compare(
    things: Floats,
    labels: Ints,
    places: tuple[int, int, int],
    there: tuple[NDArray[np.int64], NDArray[np.int64]],
    counts: Counts,
) -> None:
    """Count what follows what between two decisions; identities ascend at each."""
    old, begin, end = places
    before, now = there
    i, j = old, begin
    while i < begin or j < end:
        if j == end or (i < begin and things[i, ID] < things[j, ID]):
            if now[labels[i]] < before[labels[i]]:
                counts.ends[labels[i]] += 1
            i += 1
        elif i == begin or things[j, ID] < things[i, ID]:
            if now[labels[j]] > before[labels[j]]:
                counts.begins[labels[j]] += 1
            j += 1
        else:
            a, b = labels[i], labels[j]
            if a != b and now[b] > before[b] and now[a] < before[a]:
                counts.follows[a, b] += 1
            i += 1
            j += 1
