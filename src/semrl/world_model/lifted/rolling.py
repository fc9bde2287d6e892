"""Rolling a scene forward under sequences of actions, in compiled code."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.concepts.scenes import AGE, CONCEPT, VX, VX_1, VX_2, VY, VY_1, VY_2, X, Y
from semrl.core import Floats, Ints
from semrl.core.kernels import compiled
from semrl.world_model.lifted.features import PAST_ACTIONS, Kinds, describe, width
from semrl.world_model.lifted.motion import ABSOLUTE
from semrl.world_model.lifted.play import ENTRY
from semrl.world_model.tree_rolling import branches

_AWAY = -2
"""Of a thing whose successor will come in, in place of its concept: this, less the concept; its age is how soon."""

Trees = tuple[NDArray[Any], Ints]
"""``(m,)`` of `NODE` and ``(members, c, 8)`` roots among them; −1 where there is no tree."""


@compiled
def roll(  # noqa: PLR0917 - compiled functions take no keywords
    trees: Trees, kinds: Kinds, objects: Floats, past: Floats, sequences: Ints, relations: int
) -> tuple[Floats, Floats, Floats]:
    """Roll sequences of actions forward in every member.

    Parameters
    ----------
    trees, kinds
        What was learned.
    objects
        ``(k, 14)`` of the present.
    past
        ``(3,)`` actions before, the newest first.
    sequences
        ``(s, t)``.
    relations
        Families that things are related to.

    Returns
    -------
    tuple
        ``(s, t, k, 3)``: x, y and whether it is there, of each object as the first member predicts; ``(members, s,
        t)`` rewards; ``(members, s)`` returns expected beyond. After its first reward a scenario stands still and is
        worth no more.
    """
    nodes, roots = trees
    members, (n, length), k = roots.shape[0], sequences.shape, len(objects)
    begins, origins = branches(sequences)
    order = np.argsort(begins, kind="mergesort")
    rewards, values = np.zeros((members, n, length), np.float32), np.zeros((members, n), np.float32)
    scenes = np.empty((n, length + 1, k, objects.shape[1]), np.float32)
    over = np.zeros((n, length + 1), np.bool_)
    for member in range(members - 1, -1, -1):  # the first one last: what it predicts stays
        for s in order:
            begin, origin = begins[s], origins[s]
            if begin == 0:
                scenes[s, 0], over[s, 0] = objects, False
            else:  # it is like another one up to there
                for t in range(begin + 1):
                    scenes[s, t], over[s, t] = scenes[origin, t], over[origin, t]
                rewards[member, s, :begin] = rewards[member, origin, :begin]
            outputs = scenes[s], over[s], rewards[member, s]
            _roll_one((nodes, roots[member]), kinds, (past, sequences[s]), begin, outputs, relations)
            if not over[s, length]:
                values[member, s] = _value((nodes, roots[member]), kinds, (past, sequences[s]), scenes[s, length],
                                           relations)  # fmt: skip
    paths = np.empty((n, length, k, 3), np.float32)
    for s in range(n):
        for t in range(length):
            for i in range(k):
                one = scenes[s, t + 1, i]
                paths[s, t, i, 0], paths[s, t, i, 1], paths[s, t, i, 2] = one[X], one[Y], one[CONCEPT] >= 0
    return paths, rewards, values


@compiled
def _roll_one(  # noqa: PLR0917 - compiled functions take no keywords
    trees: tuple[NDArray[Any], Ints],
    kinds: Kinds,
    acted: tuple[Floats, Ints],
    begin: int,
    outputs: tuple[Floats, NDArray[np.bool_], Floats],
    relations: int,
) -> None:
    """Roll one sequence forward from a decision on, writing scenes, whether it is over, and rewards."""
    scenes, over, rewards = outputs
    row, actions = np.empty(width(relations), np.float32), np.empty(PAST_ACTIONS + 1, np.float32)
    for t in range(begin, len(rewards)):
        scenes[t + 1], over[t + 1], rewards[t] = scenes[t], over[t], 0
        if over[t]:
            continue
        _recent(acted, t, actions)
        reward = _step(trees, kinds, actions, scenes[t], scenes[t + 1], row)
        rewards[t] = np.rint(reward)
        over[t + 1] = rewards[t] != 0


@compiled
def _recent(acted: tuple[Floats, Ints], t: int, actions: Floats) -> None:
    """Write the action of decision `t` and those before it."""
    past, sequence = acted
    for k in range(len(actions)):
        if t - k >= len(sequence):
            actions[k] = -1
        else:
            actions[k] = sequence[t - k] if t >= k else past[k - t - 1]


@compiled
def _step(  # noqa: PLR0917
    trees: tuple[NDArray[Any], Ints], kinds: Kinds, actions: Floats, now: Floats, after: Floats, row: Floats
) -> float:
    """Move every object on by one decision; return the reward, the largest that one of them brings."""
    nodes, roots = trees
    reward = 0.0
    for i in range(len(now)):
        concept = int(now[i, CONCEPT])
        if concept <= _AWAY:
            _wait(after[i])
            continue
        if concept < 0 or not kinds.moving[concept] or roots[concept, 0] < 0:
            continue
        describe(now, i, actions, kinds, row)
        if roots[concept, 3] >= 0:
            brings = _ask(nodes, roots[concept, 3], row, 0.0)
            if abs(brings) > abs(reward):
                reward = brings
        one = after[i]
        if _ask(nodes, roots[concept, 2], row, 0.0) > 0.5:
            if roots[concept, ENTRY] < 0:
                one[CONCEPT] = -1
            else:
                one[X] = _ask(nodes, roots[concept, ENTRY], row, 0.0)
                one[Y] = _ask(nodes, roots[concept, ENTRY + 1], row, 0.0)
                one[AGE] = -max(np.rint(_ask(nodes, roots[concept, ENTRY + 2], row, 0.0)), 1.0)
                one[CONCEPT] = _AWAY - concept
                _wait(one)
            continue
        vx, vy = _ask(nodes, roots[concept, 0], row, now[i, VX]), _ask(nodes, roots[concept, 1], row, now[i, VY])
        one[VX_2], one[VY_2], one[VX_1], one[VY_1] = now[i, VX_1], now[i, VY_1], now[i, VX], now[i, VY]
        one[VX], one[VY] = vx, vy
        one[X], one[Y] = now[i, X] + vx, now[i, Y] + vy
        one[AGE] = min(now[i, AGE] + 1, 4)
    return reward


@compiled
def _wait(one: Floats) -> None:
    """Let a decision go by for what is away; what comes in is seen for the first time."""
    one[AGE] += 1
    if one[AGE] >= 0:
        one[CONCEPT] = _AWAY - one[CONCEPT]
        one[AGE] = 0
        one[VX : VY_2 + 1] = 0


@compiled
def _ask(nodes: NDArray[Any], root: int, row: Floats, before: float) -> float:
    """Return what a tree predicts: the mean of a leaf, added to what was before unless it says otherwise."""
    at = root
    while nodes[at].column >= 0:
        at = nodes[at].left + np.int32(row[nodes[at].column] > nodes[at].cut)
    return float(nodes[at].mean if nodes[at].left == ABSOLUTE else before + nodes[at].mean)


@compiled
def _value(
    trees: tuple[NDArray[Any], Ints], kinds: Kinds, acted: tuple[Floats, Ints], scene: Floats, relations: int
) -> float:
    """Return what is expected beyond the last scene: by the first thing that predicts returns, else the mean."""
    nodes, roots = trees
    row, actions = np.empty(width(relations), np.float32), np.empty(PAST_ACTIONS + 1, np.float32)
    _recent(acted, len(acted[1]), actions)
    mean = 0.0
    for concept in range(len(roots)):
        if roots[concept, 4] < 0:
            continue
        mean = nodes[roots[concept, 4]].mean
        for i in range(len(scene)):
            if scene[i, CONCEPT] == concept:
                describe(scene, i, actions, kinds, row)
                return _ask(nodes, roots[concept, 4], row, 0.0)
    return mean
