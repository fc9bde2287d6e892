"""Rules that people have switched off: where one holds, the trees say that nothing particular comes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.world_model.tree_kernels import NODE

Region = tuple[tuple[int, float, float], ...]
"""Bounds that hold together: a column of what trees see, above what it is, and up to what."""


class SwitchedOff(NamedTuple):
    """A rule that does not count."""

    target: int
    """Which of the predicted numbers it is about."""
    region: Region
    """Where it holds."""


def without_rules(nodes: NDArray[Any], roots: Ints, off: Sequence[SwitchedOff]) -> tuple[NDArray[Any], Ints]:
    """Return trees that predict 0 where some rules hold, in every forest, and what they did elsewhere.

    0 is no change, or no other than the last where a number goes on by itself; no reward; no return. Each tree gets a
    new root for each rule, which asks its bounds one after the other; whoever is outside of one goes to the old root.

    Parameters
    ----------
    nodes
        ``(k,)`` of `NODE`.
    roots
        ``(members, targets)``.
    off
        The rules.
    """
    parts, roots, size = [nodes], roots.copy(), len(nodes)
    for rule in off:
        asked = [
            (column, cut, inside) for column, *cuts in rule.region for cut, inside in zip(cuts, (1, 0), strict=True)
        ]
        asked = [one for one in asked if np.isfinite(one[1])]
        for member in range(len(roots)):
            old = np.concatenate(parts)[roots[member, rule.target]]
            chain = _chain(asked, old, size)
            roots[member, rule.target] = size
            parts.append(chain)
            size += len(chain)
    return np.concatenate(parts), roots


def _chain(asked: Sequence[tuple[int, float, int]], old: NDArray[Any], begin: int) -> NDArray[Any]:
    """Return nodes, to stand at `begin`, that ask all bounds; the first is the root."""
    chain = np.zeros(1 + 2 * len(asked), NODE)
    at = 0
    for number, (column, cut, inside) in enumerate(asked):
        children = 1 + 2 * number
        chain[at] = column, begin + children, cut, 0.0
        chain[children + 1 - inside] = old
        at = children + inside
    chain[at] = -1, -1, 0.0, 0.0
    return chain
