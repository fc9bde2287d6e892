"""Sequences of actions rolled forward through forests, in compiled code."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import NO_ACTION, Floats, Ints
from semrl.core.kernels import compiled
from semrl.world_model.tree_kernels import Relations, Trees, descend, lay_out_lanes, width

Lanes = tuple[Floats, Floats, Ints, Ints, Ints]
"""Of each forest the states in a ring, ``(m, h, d, n)``, the actions before, ``(m, p, n)``, which sequence a lane is,
``(m, n)``, in which lane a sequence is, ``(m, n)``, −1 where it has ended, and how many lanes there are, ``(m,)``."""


@compiled
def roll(  # noqa: PLR0917 - compiled functions take no keywords
    trees: Trees,
    inertia: Floats,
    states: Floats,
    actions: Floats,
    sequences: Ints,
    relations: Relations,
    ending: NDArray[np.bool_],
) -> tuple[Floats, Floats, Floats]:
    """Roll sequences of actions forward in every forest; see `semrl.world_model.trees.Forests.roll`.

    All forests roll at once. Each has a lane for every sequence that has begun to differ from those before it and that
    no reward has ended: `ending`, ``(2,)``, says whether a loss and whether a gain ends one.
    """
    (members, targets), (n, length) = trees[1].shape, sequences.shape
    begins, origins = branches(sequences)
    order, place_of = _by_time(begins, length)
    branching = begins[order], place_of[origins[order]]
    predicted = np.empty((n, length, targets - 2), np.float32)
    rewards, values = np.zeros((members, n, length), np.float32), np.zeros((members, n), np.float32)
    lanes = _lanes(states, actions, members, n)
    outputs = predicted, rewards, values
    ends = _roll_lanes(trees, inertia, (sequences[order], branching), lanes, outputs, relations, ending)
    _complete(branching, ends, predicted, rewards, values)
    return predicted[place_of], rewards[:, place_of], values[:, place_of]


@compiled
def _by_time(begins: Ints, length: int) -> tuple[Ints, Ints]:
    """Return the order in which sequences begin, of equal ones the first first, and each one's place in it."""
    order, place_of = np.empty(len(begins), np.int64), np.empty(len(begins), np.int64)
    place = 0
    for t in range(length + 1):
        for s in range(len(begins)):
            if begins[s] == t:
                order[place], place_of[s] = s, place
                place += 1
    return order, place_of


@compiled
def branches(sequences: Ints) -> tuple[Ints, Ints]:
    """Return for how long each sequence is like one before it, and like which, ``(s,)`` each.

    What sequences have in common is rolled once: by the first of them, which the others leave, each at its time.
    """
    n, length = sequences.shape
    begins, origins, like = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64)
    first = np.empty((n, sequences.max() + 1), np.int64)  # of those that are like this one so far and now act so
    for t in range(length):
        first[:] = -1
        for s in range(n):
            action = sequences[s, t]
            if first[like[s], action] < 0:
                first[like[s], action] = s
            like[s] = first[like[s], action]
            if like[s] != s:
                begins[s], origins[s] = t + 1, like[s]
    return begins, origins


@compiled
def _lanes(states: Floats, actions: Floats, members: int, n: int) -> Lanes:
    """Return the lanes of all forests, of which one, that of the first sequence, has begun."""
    window = np.empty((members, *states.shape, n), np.float32)
    before = np.empty((members, len(actions), n), np.float32)
    window[..., 0], before[..., 0] = states, actions
    return (
        window,
        before,
        np.zeros((members, n), np.int64),
        np.zeros((members, n), np.int64),
        np.ones(members, np.int64),
    )


@compiled
def _roll_lanes(  # noqa: PLR0917
    trees: Trees,
    inertia: Floats,
    what: tuple[Ints, tuple[Ints, Ints]],
    lanes: Lanes,
    outputs: tuple[Floats, Floats, Floats],
    relations: Relations,
    ending: NDArray[np.bool_],
) -> Ints:
    """Roll forward, writing the first forest's states, ``(n, t, d)``, rewards, ``(m, n, t)``, and values, ``(m, n)``.

    Returns when each sequence ended in the first forest, ``(n,)``: at a decision whose reward ends it, or the last.
    """
    (nodes, roots), (sequences, branching) = trees, what
    (predicted, rewards, values), (window, before, _, _, counts) = outputs, lanes
    (n, length, dimension), members, past = predicted.shape, len(roots), window.shape[1]
    rows = np.empty((members, width(dimension, past, before.shape[1], relations), n), np.float32)
    changes, chosen = np.empty((members, dimension + 1, n), np.float32), np.empty((members, n), np.float32)
    ends, newest, begun = np.full(n, length - 1), 0, 1
    for t in range(length):
        begun = _begin(lanes, branching, begun, t)
        for member in range(members):
            count = counts[member]
            for lane in range(count):
                chosen[member, lane] = sequences[lanes[2][member, lane], t]
            lay_out_lanes((window[member], newest), before[member], chosen[member], rows[member], count, relations)
        descend((nodes, roots[:, : dimension + 1]), rows, counts, changes)
        newest = (newest - 1) % past
        for member in range(members):
            _advance(window[member], newest, inertia, changes[member], counts[member])
            _note_actions(before[member], chosen[member], counts[member])
        for lane in range(counts[0]):
            predicted[lanes[2][0, lane], t] = window[0, newest, :, lane]
        _reward(lanes, changes[:, dimension], rewards, (ends, ending), t)
    _begin(lanes, branching, begun, length)
    chosen[:] = NO_ACTION
    for member in range(members):
        lay_out_lanes((window[member], newest), before[member], chosen[member], rows[member], counts[member], relations)
    descend((nodes, roots[:, dimension + 1 :]), rows, counts, changes)
    for member in range(members):
        for lane in range(counts[member]):
            values[member, lanes[2][member, lane]] = changes[member, 0, lane]
    return ends


@compiled
def _begin(lanes: Lanes, branching: tuple[Ints, Ints], begun: int, t: int) -> int:
    """Let sequences begin whose time has come, where those that they leave are now; return how many have begun."""
    (window, before, sequence_of, lane_of, counts), (begins, origins) = lanes, branching
    while begun < len(begins) and begins[begun] == t:
        for member in range(len(window)):
            old, new = lane_of[member, origins[begun]], counts[member]
            lane_of[member, begun] = new if old >= 0 else old
            if old >= 0:
                window[member, ..., new], before[member, :, new] = window[member, ..., old], before[member, :, old]
                sequence_of[member, new] = begun
                counts[member] += 1
        begun += 1
    return begun


@compiled
def _advance(window: Floats, newest: int, inertia: Floats, changes: Floats, n: int) -> None:
    """Put the next state of the first ``n`` lanes in the newest place of the ring.

    What goes on by itself changes by its last change and what the trees predict.
    """
    past, dimension, _ = window.shape
    for i in range(dimension):
        following, now, then = window[newest, i], window[(newest + 1) % past, i], window[(newest + 2) % past, i]
        change = changes[i]
        if inertia[i]:
            for s in range(n):
                change[s] += inertia[i] * (now[s] - then[s])
        for s in range(n):
            following[s] = now[s] + change[s]


@compiled
def _note_actions(before: Floats, chosen: Floats, n: int) -> None:
    """Put the actions of the first ``n`` lanes before the others, of which the last goes."""
    for h in range(len(before) - 1, 0, -1):
        before[h, :n] = before[h - 1, :n]
    if len(before):
        before[0, :n] = chosen[:n]


@compiled
def _reward(lanes: Lanes, predicted: Floats, rewards: Floats, what: tuple[Ints, NDArray[np.bool_]], t: int) -> None:
    """Note the rewards that lanes come to, of ``(m, n)`` predicted ones.

    Lanes that they end are taken out; the last lane takes their place.
    """
    (window, before, sequence_of, lane_of, counts), (ends, ending) = lanes, what
    for member in range(len(window)):
        for lane in range(counts[member] - 1, -1, -1):
            reward, sequence = np.rint(predicted[member, lane]), sequence_of[member, lane]
            if reward == 0:
                continue
            rewards[member, sequence, t] = reward
            if not ending[int(reward > 0)]:
                continue
            lane_of[member, sequence] = -1
            if member == 0:
                ends[sequence] = t
            counts[member] -= 1
            last = counts[member]
            if lane < last:
                window[member, ..., lane], before[member, :, lane] = window[member, ..., last], before[member, :, last]
                sequence_of[member, lane] = sequence_of[member, last]
                lane_of[member, sequence_of[member, lane]] = lane


@compiled
def _complete(branching: tuple[Ints, Ints], ends: Ints, predicted: Floats, rewards: Floats, values: Floats) -> None:
    """Copy what sequences share with those that they leave; where one has ended its state stays."""
    begins, origins = branching
    n, length, _ = predicted.shape
    for s in range(n):
        begin, origin = begins[s], origins[s]
        if s:
            predicted[s, :begin], rewards[:, s, :begin] = predicted[origin, :begin], rewards[:, origin, :begin]
            ends[s] = min(ends[s], ends[origin]) if ends[origin] < begin else ends[s]
        if s and begin == length:
            values[:, s] = values[:, origin]
        for t in range(max(begin, ends[s] + 1), length):
            predicted[s, t] = predicted[s, t - 1]
