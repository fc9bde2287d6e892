"""The memory of a CF tree: plain arrays that compiled code fills, that grow by doubling and go out and in."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core.arrays import Arrays
from semrl.core.errors import DataError

N_LEAVES, N_NODES, ROOT, HEIGHT, NEXT_ID = range(5)  # places in `Store.counters`


class Features(NamedTuple):
    """Cluster features of BETULA, one a row: count n, mean, sum of squared distances to the mean S."""

    means: NDArray[np.float64]  # (c, d)
    counts: NDArray[np.int64]  # (c,)
    deviations: NDArray[np.float64]  # (c,) S


class Store(NamedTuple):
    """A CF tree as arrays; rows behind the counters are spare room.

    ``b`` is the branching factor: each node has one place more, taken for a moment before it is split.
    """

    leaves: Features
    leaf_ids: NDArray[np.int64]  # (c,) ascending
    nodes: Features  # of all rows below each node, but for the root, which nobody asks
    children: NDArray[np.int64]  # (m, b + 1) leaf rows below a bottom node, else nodes
    sizes: NDArray[np.int64]  # (m,) children in use
    parents: NDArray[np.int64]  # (m,) -1 above the root
    is_bottom: NDArray[np.bool_]  # (m,) whether the children are leaves
    counters: NDArray[np.int64]  # (5,)
    threshold: NDArray[np.float64]  # (2,) largest radius of a leaf, largest distance of a row from its mean


def new_store(dimension: int, branching_factor: int, threshold: float, *, reach: float, leaves: int = 64) -> Store:
    """Make an empty tree: one bottom node as root, and room for some leaves."""
    nodes = 16
    store = Store(
        leaves=_new_features(leaves, dimension),
        leaf_ids=np.zeros(leaves, np.int64),
        nodes=_new_features(nodes, dimension),
        children=np.zeros((nodes, branching_factor + 1), np.int64),
        sizes=np.zeros(nodes, np.int64),
        parents=np.full(nodes, -1, np.int64),
        is_bottom=np.zeros(nodes, np.bool_),
        counters=np.array([0, 1, 0, 1, 0], np.int64),
        threshold=np.array([threshold, reach]),
    )
    store.is_bottom[0] = True
    return store


def _new_features(n: int, dimension: int) -> Features:
    return Features(np.zeros((n, dimension)), np.zeros(n, np.int64), np.zeros(n))


def room_is_scarce(store: Store) -> tuple[bool, bool]:
    """Say whether a row might find no room, among leaves and among nodes (each level may split)."""
    leaves_left = len(store.leaf_ids) - store.counters[N_LEAVES]
    nodes_left = len(store.sizes) - store.counters[N_NODES]
    return bool(leaves_left <= 0), bool(nodes_left <= store.counters[HEIGHT])


def doubled(store: Store) -> Store:
    """Return the same tree with twice the room wherever it has become scarce."""
    leaves, nodes = room_is_scarce(store)
    if leaves:
        store = store._replace(leaves=Features(*map(_double, store.leaves)), leaf_ids=_double(store.leaf_ids))
    if nodes:
        names = ("children", "sizes", "parents", "is_bottom")
        wider: dict[str, Any] = {name: _double(getattr(store, name)) for name in names}
        store = store._replace(nodes=Features(*map(_double, store.nodes)), **wider)
    return store


def _double(array: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([array, np.zeros_like(array)])


def _flat(store: Store) -> Arrays:
    """Return the arrays by name, those of features as ``leaves_means`` and the like."""
    arrays: Arrays = {}
    for name, value in store._asdict().items():
        if isinstance(value, Features):
            arrays |= {f"{name}_{key}": array for key, array in value._asdict().items()}
        else:
            arrays[name] = value
    return arrays


def store_to_arrays(store: Store) -> Arrays:
    """Return copies of all arrays, without the spare room."""
    used = dict.fromkeys(("counters", "threshold"))  # whole
    leaves, nodes = int(store.counters[N_LEAVES]), int(store.counters[N_NODES])
    return {
        name: array[: used.get(name, leaves if name.startswith("lea") else nodes)].copy()
        for name, array in _flat(store).items()
    }


def store_from_arrays(arrays: Arrays, branching_factor: int) -> Store:
    """Make a tree of what `store_to_arrays` returned.

    Raises
    ------
    DataError
        An array is missing or of another type, or they do not make one tree of this branching factor.
        (Compiled code checks no bounds and would read outside its memory.)
    """
    blank = _flat(new_store(0, branching_factor, 0.0, reach=0.0))
    missing = sorted(name for name in blank if name not in arrays or arrays[name].dtype != blank[name].dtype)
    if missing:
        raise DataError(f"the saved CF tree lacks {', '.join(missing)}")
    flat = {name: np.array(arrays[name], order="C") for name in blank}
    parts: dict[str, Any] = {name: flat[name] for name in Store._fields if name in flat}
    for name in ("leaves", "nodes"):
        parts[name] = Features(*[flat[f"{name}_{key}"] for key in Features._fields])
    store = Store(**parts)
    if not _is_sound(store, branching_factor):
        raise DataError(f"the saved arrays are not a CF tree of branching factor {branching_factor}")
    return store


def _is_sound(store: Store, branching_factor: int) -> bool:
    """Whether shapes agree and every index points at something."""
    if store.counters.shape != (5,) or store.threshold.shape != (2,) or store.sizes.ndim != 1:
        return False
    leaves, nodes, root = (int(store.counters[place]) for place in (N_LEAVES, N_NODES, ROOT))
    dimension = store.leaves.means.shape[-1]
    if [array.shape for array in (*store.leaves, store.leaf_ids)] != [(leaves, dimension), *[(leaves,)] * 3]:
        return False
    per_node = (*store.nodes, store.children, store.sizes, store.parents, store.is_bottom)
    shapes = [(nodes, dimension), (nodes,), (nodes,), (nodes, branching_factor + 1), *[(nodes,)] * 3]
    if [array.shape for array in per_node] != shapes:
        return False
    used = np.arange(branching_factor + 1) < store.sizes[:, None]  # (m, b + 1)
    limits = np.where(store.is_bottom, leaves, nodes)[:, None]  # (m, 1)
    inside = (store.children >= 0) & (store.children < limits)
    sizes_fit = ((store.sizes > 0) | (leaves == 0)) & (store.sizes <= branching_factor)
    parents_fit = (store.parents >= -1) & (store.parents < nodes)
    return 0 <= root < nodes and bool(inside[used].all() and sizes_fit.all() and parents_fit.all())
