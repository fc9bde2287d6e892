"""The compiled half of the CF tree: the loops that run for every row.

Cluster features are (n, mean, S) as in BETULA (Lang & Schubert, "BETULA: Numerically Stable CF-Trees for
BIRCH Clustering", SISAP 2020): nothing is found by subtracting two large sums, so an offset of the data costs
no precision.
"""

import numpy as np
from numpy.typing import NDArray

from semrl.core.kernels import compiled, compiler
from semrl.perception.clustering.cf_store import HEIGHT, N_LEAVES, N_NODES, NEXT_ID, ROOT, Features, Store

# A sum may be taken in another order, to use vector registers; it is still the same order at every call.
compiled_sum = compiler(fastmath={"reassoc", "contract"})

LARGEST = 1e100  # beyond this, squares of differences would leave float64
CHUNK = 32  # numbers compared between two looks at the bound


@compiled
def usable(X: NDArray[np.float64]) -> bool:
    """Whether every number is finite and small enough to be squared."""
    for i in range(X.shape[0]):
        for j in range(X.shape[1]):
            if not abs(X[i, j]) <= LARGEST:  # false for NaN too
                return False
    return True


@compiled_sum
def squared_distance(A: NDArray[np.float64], i: int, B: NDArray[np.float64], j: int) -> float:
    """Return ``|A[i] - B[j]|²``."""
    a, b = A[i], B[j]
    total = 0.0
    for k in range(len(a)):
        difference = a[k] - b[k]
        total += difference * difference
    return total


@compiled_sum
def bounded_distance(A: NDArray[np.float64], i: int, B: NDArray[np.float64], j: int, bound: float) -> float:
    """Return ``|A[i] - B[j]|²``, or a partial sum of it that is already above `bound`."""
    a, b = A[i], B[j]
    dimension = len(a)
    if dimension <= CHUNK:
        return squared_distance(A, i, B, j)
    total, start = 0.0, 0
    while start + CHUNK <= dimension:
        part = 0.0
        for k in range(CHUNK):
            difference = a[start + k] - b[start + k]
            part += difference * difference
        total += part
        start += CHUNK
        if total > bound:
            return total
    for k in range(start, dimension):
        difference = a[k] - b[k]
        total += difference * difference
    return total


@compiled
def merged_deviation(a: Features, i: int, b: Features, j: int, distance: float) -> float:
    """Return S of the union: S₁ + S₂ + n₁n₂/(n₁ + n₂)·|m₁ − m₂|²."""
    n, m = a.counts[i], b.counts[j]
    return a.deviations[i] + b.deviations[j] + distance * (n * (m / (n + m)))  # type: ignore[no-any-return]


@compiled
def absorb(a: Features, i: int, b: Features, j: int) -> None:
    """Merge feature `j` of `b` into feature `i` of `a`."""
    distance = squared_distance(a.means, i, b.means, j)
    a.deviations[i] = merged_deviation(a, i, b, j, distance)
    a.counts[i] += b.counts[j]
    share = b.counts[j] / a.counts[i]
    for k in range(a.means.shape[1]):
        a.means[i, k] += (b.means[j, k] - a.means[i, k]) * share


@compiled
def below(store: Store, node: int) -> Features:
    """Return the features among which the children of `node` are counted."""
    return store.leaves if store.is_bottom[node] else store.nodes


@compiled
def nearest_child(store: Store, node: int, X: NDArray[np.float64], i: int) -> tuple[int, float]:
    """Return the child of `node` with the mean nearest to ``X[i]``, and its squared distance."""
    means = below(store, node).means
    best, best_distance = store.children[node, 0], np.inf
    for k in range(store.sizes[node]):
        child = store.children[node, k]
        distance = squared_distance(means, child, X, i)
        if distance < best_distance:
            best, best_distance = child, distance
    return best, best_distance


@compiled
def new_node(store: Store, is_bottom: bool) -> int:
    """Take an empty node from the spare room."""
    node = store.counters[N_NODES]
    store.counters[N_NODES] += 1
    store.sizes[node] = 0
    store.parents[node] = -1
    store.is_bottom[node] = is_bottom
    return node  # type: ignore[no-any-return]


@compiled
def append_child(store: Store, node: int, child: int) -> None:
    """Hang a leaf row or a node below `node`, whose features are left to the caller."""
    store.children[node, store.sizes[node]] = child
    store.sizes[node] += 1
    if not store.is_bottom[node]:
        store.parents[child] = node


@compiled
def sum_children(store: Store, node: int) -> None:
    """Compute the features of a node anew from its children."""
    features = below(store, node)
    store.nodes.counts[node] = 0
    store.nodes.deviations[node] = 0.0
    store.nodes.means[node] = 0.0
    for k in range(store.sizes[node]):
        absorb(store.nodes, node, features, store.children[node, k])


@compiled
def farthest_children(store: Store, node: int) -> tuple[int, int]:
    """Return the (first) two children whose means are farthest apart."""
    means = below(store, node).means
    children, size = store.children[node], store.sizes[node]
    first, second, farthest = children[0], children[1], -1.0
    for i in range(size):
        for j in range(i + 1, size):
            distance = squared_distance(means, children[i], means, children[j])
            if distance > farthest:
                first, second, farthest = children[i], children[j], distance
    return first, second


@compiled
def split(store: Store, node: int) -> None:
    """Divide a node between its two farthest children: it keeps the first, a new node takes the second."""
    means = below(store, node).means
    first, second = farthest_children(store, node)
    children = store.children[node, : store.sizes[node]].copy()
    twin = new_node(store, store.is_bottom[node])
    store.sizes[node] = 0
    for child in children:
        nearer = squared_distance(means, child, means, first) < squared_distance(means, child, means, second)
        append_child(store, node if child == first or nearer else twin, child)
    sum_children(store, node)
    sum_children(store, twin)
    if node == store.counters[ROOT]:
        root = new_node(store, False)
        append_child(store, root, node)
        store.counters[ROOT] = root
        store.counters[HEIGHT] += 1
    append_child(store, store.parents[node], twin)


@compiled
def insert_one(store: Store, rows: Features, i: int) -> int:
    """Put one feature into the tree and return its leaf row."""
    node = store.counters[ROOT]
    while not store.is_bottom[node]:
        node, _ = nearest_child(store, node, rows.means, i)
        absorb(store.nodes, node, rows, i)
    if store.sizes[node] > 0:
        nearest, distance = nearest_child(store, node, rows.means, i)
        largest = (store.leaves.counts[nearest] + rows.counts[i]) * store.threshold[0] ** 2
        near = distance <= store.threshold[1] ** 2
        if near and merged_deviation(store.leaves, nearest, rows, i, distance) <= largest:
            absorb(store.leaves, nearest, rows, i)
            return nearest
    leaf = store.counters[N_LEAVES]
    store.counters[N_LEAVES] += 1
    store.leaves.counts[leaf] = 0
    store.leaves.deviations[leaf] = 0.0
    store.leaves.means[leaf] = 0.0
    absorb(store.leaves, leaf, rows, i)
    store.leaf_ids[leaf] = store.counters[NEXT_ID]
    store.counters[NEXT_ID] += 1
    append_child(store, node, leaf)
    while node >= 0 and store.sizes[node] == store.children.shape[1]:
        split(store, node)
        node = store.parents[node]
    return leaf  # type: ignore[no-any-return]


@compiled
def insert_rows(store: Store, rows: Features, start: int, most_leaves: int, ids: NDArray[np.int64]) -> int:
    """Insert features from `start` on and write the id of each one's leaf; return how far it came.

    It stops before a feature for which there may be no room, and after one with which the tree holds more
    than `most_leaves`.
    """
    for i in range(start, len(rows.counts)):
        nodes_left = store.sizes.shape[0] - store.counters[N_NODES]
        if store.counters[N_LEAVES] == store.leaf_ids.shape[0] or nodes_left <= store.counters[HEIGHT]:
            return i
        ids[i] = store.leaf_ids[insert_one(store, rows, i)]
        if store.counters[N_LEAVES] > most_leaves:
            return i + 1
    return len(rows.counts)


@compiled
def nearest_leaves(store: Store, X: NDArray[np.float64], exact: bool) -> NDArray[np.int64]:
    """Return the leaf row for each row of X: where a descent ends, or the nearest of all."""
    means = store.leaves.means
    found = np.empty(X.shape[0], np.int64)
    for i in range(X.shape[0]):
        node = store.counters[ROOT]
        while not store.is_bottom[node]:
            node, _ = nearest_child(store, node, X, i)
        best, _ = nearest_child(store, node, X, i)
        if exact and node != store.counters[ROOT]:
            # The descent gives a bound that ends most comparisons after their first few numbers.
            bound = bounded_distance(means, best, X, i, np.inf)
            for leaf in range(store.counters[N_LEAVES]):
                distance = bounded_distance(means, leaf, X, i, bound)
                if distance < bound or (distance == bound and leaf < best):
                    best, bound = leaf, distance
        found[i] = best
    return found


@compiled
def sibling_radii(store: Store) -> NDArray[np.float64]:
    """Return for each leaf with siblings the radius that it and the nearest of them would have as one."""
    leaves = store.leaves
    radii = np.empty(store.counters[N_LEAVES], np.float64)
    found = 0
    for node in range(store.counters[N_NODES]):
        size = store.sizes[node] if store.is_bottom[node] else 0
        for i in range(size):
            leaf, nearest, least = store.children[node, i], -1, np.inf
            for j in range(size):
                other = store.children[node, j]
                distance = squared_distance(leaves.means, leaf, leaves.means, other)
                if other != leaf and distance < least:
                    nearest, least = other, distance
            if nearest >= 0:
                S = merged_deviation(leaves, leaf, leaves, nearest, least)
                radii[found] = np.sqrt(S / (leaves.counts[leaf] + leaves.counts[nearest]))
                found += 1
    return radii[:found]
