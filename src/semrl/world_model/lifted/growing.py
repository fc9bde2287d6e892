"""Growing the trees of one member: for each concept its next velocity, whether it vanishes, the reward, the return."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays
from semrl.core.kernels import compiled
from semrl.world_model.cart import bins_of, grow_tree
from semrl.world_model.lifted.config import LiftedConfig
from semrl.world_model.lifted.features import ACTION, N_OWN
from semrl.world_model.lifted.motion import grow_motion
from semrl.world_model.lifted.play import ENTRY, TARGETS
from semrl.world_model.tree_kernels import NODE

Seen = tuple[Floats, Floats]
"""What is asked of the things of one concept, ``(n, f)``, and their targets, ``(n, 10)``."""

_FEWEST = 20  # sightings that trees are grown from
_FEWEST_ENTRIES = 5  # successors that were seen to come in
_ENTRY_PX = 3.0  # or decisions; what comes in so near to where and when it is expected was predicted
_GOOD_SHARE = 0.9  # of what the best explains


class Member(NamedTuple):
    """The trees of one member, one behind the other."""

    nodes: NDArray[Any]
    """``(m,)`` of `NODE`."""
    roots: Ints
    """``(c, 8)`` int64: where the tree for each target of each concept begins; −1 where there is none."""

    @classmethod
    def empty(cls) -> "Member":
        """Make a member without trees."""
        return cls(np.empty(0, NODE), np.zeros((0, len(TARGETS)), np.int64))

    def to_arrays(self) -> Arrays:
        """Return the trees; a node as its four numbers."""
        return {name: self.nodes[name].copy() for name in NODE.names or ()} | {"roots": self.roots}

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "Member":
        """Make trees again."""
        nodes = np.empty(len(arrays["column"]), NODE)
        for name in NODE.names or ():
            nodes[name] = arrays[name]
        roots = np.full((len(arrays["roots"]), len(TARGETS)), -1, np.int64)
        roots[:, : arrays["roots"].shape[1]] = arrays["roots"]  # older checkpoints knew no successors
        return cls(nodes, roots)


def grow_member(
    seen: dict[int, Seen],
    concepts: int,
    reward_concept: int,
    config: LiftedConfig,
    rng: np.random.Generator,
    *,
    draws: bool,
) -> Member:
    """Grow trees from a draw of what was seen of each concept.

    Parameters
    ----------
    seen
        Concept → what was seen of its things.
    concepts
        How many numbers of concepts there are.
    reward_concept
        The concept that rewards are credited to; −1: none.
    config
        Fewest sightings in leaves.
    rng
        Draws.
    draws
        Whether it sees a draw of all, or all.
    """
    roots = np.full((concepts, len(TARGETS)), -1, np.int64)
    trees, size = [], 0
    for concept, (rows, targets) in seen.items():
        if len(rows) < _FEWEST:
            continue
        places, cuts = bins_of(rows)
        share = config.draw_share if draws else 1.0
        drawn = np.sort(rng.choice(len(rows), max(round(share * len(rows)), 1), replace=False))
        grown = {
            k: _grow((places, cuts, rows), targets, drawn, k, config)
            for k in range(5 if concept == reward_concept else 3)
        }
        grown |= _entries((places, cuts, rows), targets, drawn, config)
        for target, nodes in grown.items():
            nodes["left"] += np.where(nodes["column"] >= 0, size, 0).astype(np.int32)
            roots[concept, target] = size
            trees.append(nodes)
            size += len(nodes)
    return Member(np.concatenate([np.empty(0, NODE), *trees]), roots)


def _entries(
    sight: tuple[NDArray[np.uint16], list[Floats], Floats], targets: Floats, drawn: Ints, config: LiftedConfig
) -> dict[int, NDArray[Any]]:
    """Grow trees of where and when successors come in; none where they mostly come in somewhere else than predicted."""
    places, cuts, rows = sight
    vanished = drawn[targets[drawn, 2] > 0]
    drawn = vanished[~np.isnan(targets[vanished, ENTRY])]
    if len(drawn) < _FEWEST_ENTRIES:
        return {}
    grown, right = {}, np.ones(len(drawn), np.bool_)
    for target in range(ENTRY, len(TARGETS)):
        wanted = np.nan_to_num(targets[:, target]).astype(np.float64)
        grown[target] = _pruned(grow_tree(places, cuts, wanted, drawn, config.leaf_things), config.least_gain_px2)
        right &= np.abs(_predicted(grown[target], rows[drawn]) - wanted[drawn]) <= _ENTRY_PX
    return grown if 2 * right.sum() >= len(vanished) else {}


def find_reward_concept(seen: dict[int, Seen], config: LiftedConfig) -> int:
    """Return the concept that rewards are credited to, by trees of one half of the play for the other; −1: none.

    Of those whose things explain rewards nearly as well as the best, it is the one that needs the fewest cuts of what
    relates it to others: "the ball is beyond its edge" and "the ball is so far from the paddle" may both have held
    whenever a reward came, and the farther-fetched fails first elsewhere.
    """
    fits = {
        concept: _explains(*of, config) for concept, of in seen.items() if len(of[0]) >= _FEWEST and of[1][:, 3].any()
    }
    most = max((explained for explained, _ in fits.values()), default=0.0)
    good = [concept for concept, (explained, _) in fits.items() if explained > 0 and explained >= _GOOD_SHARE * most]
    return min(good, key=lambda concept: (fits[concept][1], -fits[concept][0]), default=-1)


def _explains(rows: Floats, targets: Floats, config: LiftedConfig) -> tuple[float, int]:
    """Return how much of the rewards (squared) trees explain that did not see them, and their cuts of relations."""
    rewards = targets[:, 3].astype(np.float64)
    places, cuts = bins_of(rows)
    half = np.arange(len(rows)) // min(50, len(rows) // 2) % 2  # neighbours are alike
    explained, related = 0.0, 0
    for fold in (0, 1):
        grown = grow_tree(places, cuts, rewards, np.flatnonzero(half != fold), config.leaf_things)
        nodes = _pruned(grown, config.least_gain)
        tested = half == fold
        predicted = _predicted(nodes, rows[tested])
        explained += float((rewards[tested] ** 2 - (rewards[tested] - predicted) ** 2).sum())
        related += int(np.count_nonzero(nodes["column"] >= N_OWN))
    return explained, related


def _grow(
    sight: tuple[NDArray[np.uint16], list[Floats], Floats],
    targets: Floats,
    drawn: Ints,
    target: int,
    config: LiftedConfig,
) -> NDArray[Any]:
    """Grow one tree; of velocities it predicts the change, or in leaves where that is better the value."""
    places, cuts, rows = sight
    wanted = targets[:, target].astype(np.float64)
    if TARGETS[target] == "return":
        places = places.copy()
        places[ACTION] = 0  # beyond a scenario it is not decided yet
    leaf_rows = config.value_leaf_things if TARGETS[target] == "return" else config.leaf_things
    if target >= 2:
        return _pruned(grow_tree(places, cuts, wanted, drawn, leaf_rows), config.least_gain)
    drawn = drawn[~np.isnan(wanted[drawn])]
    if not len(drawn):
        drawn = np.zeros(1, np.int64)
        wanted = rows[:, target].astype(np.float64)
    velocities = rows[:, target], np.nan_to_num(wanted).astype(np.float32)
    return grow_motion(places, cuts, velocities, drawn, (config.leaf_things, config.least_gain_px2))


def _pruned(tree: tuple[NDArray[np.int32], Floats, Floats], least_gain: float) -> NDArray[Any]:
    """Put what `grow_tree` returns side by side, without cuts that gain less than this a leaf (squared error)."""
    inner, numbers, support = tree
    nodes = np.empty(len(inner), NODE)
    nodes["column"], nodes["left"] = inner.T
    nodes["cut"], nodes["mean"] = numbers.T
    _prune(nodes, (support[:, 0] * support[:, 1]).astype(np.float64), least_gain)
    return nodes


@compiled
def _prune(nodes: NDArray[Any], losses: NDArray[np.float64], least_gain: float) -> None:
    """Make leaves of nodes below which each further leaf gains too little (cost-complexity pruning, Breiman 1984)."""
    below, leaves = losses.copy(), np.ones(len(nodes))
    for at in range(len(nodes) - 1, -1, -1):  # children come after their parents
        if nodes[at].column < 0:
            continue
        left = nodes[at].left
        n, loss = leaves[left] + leaves[left + 1], below[left] + below[left + 1]
        if losses[at] - loss < least_gain * (n - 1):
            nodes[at].column, nodes[at].left = -1, -1
        else:
            below[at], leaves[at] = loss, n


@compiled
def _leaf(nodes: NDArray[Any], row: Floats) -> int:
    """Return the leaf that a row falls into."""
    at = 0
    while nodes[at].column >= 0:
        at = nodes[at].left + np.int32(row[nodes[at].column] > nodes[at].cut)
    return at


@compiled
def _predicted(nodes: NDArray[Any], rows: Floats) -> Floats:
    """Return what a tree predicts for rows."""
    predicted = np.empty(len(rows), np.float32)
    for i in range(len(rows)):
        predicted[i] = nodes[_leaf(nodes, rows[i])].mean
    return predicted
