"""The scene graph (§3.2.3, Fig. 3.6): objects are nodes, objects close to each other are joined."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semrl.errors import DataError, UsageError
from semrl.types import Ints, SceneGraph

_ALL_PAIRS_UP_TO = 256
"""Number of objects up to which comparing all pairs beats building a tree."""

_BEYOND_ALL_PICTURES = 1 << 31
"""Half pixels; what lies further away is no place."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneGraphConfig:
    """Which objects a scene has, and which of them are joined."""

    proximity_px: float = 20.0
    """Objects whose centres are at most this far apart, in pixels, are joined."""

    omit_scenery: bool = False
    """Leave out objects of kinds that never move, such as walls and the digits of a score."""

    scenery_frames: int = 500
    """Frames in which kinds are seen to move or not, where scenery is left out."""

    def __post_init__(self) -> None:
        if not 0 <= self.proximity_px < np.inf:
            raise UsageError(f"proximity_px must be a finite number from 0 on, not {self.proximity_px}")
        if self.scenery_frames < 2:
            raise UsageError(f"scenery_frames must be 2 or more, not {self.scenery_frames}")


def build_scene_graph(classes: NDArray[Any], centres_px: NDArray[Any], proximity_px: float) -> SceneGraph:
    """Join all objects of a frame that are close enough (§3.2.3).

    Parameters
    ----------
    classes
        ``(n,)`` integers, the class number of each object.
    centres_px
        ``(n, 2)`` numbers, row and column of each object's centre in pixels.
    proximity_px
        Largest distance of two centres that are joined, in pixels, inclusive.

    Returns
    -------
    SceneGraph
        With ``m`` edges in ascending order, weighted by the distance of the centres. It shares no
        memory with the arguments. No objects give an empty graph.

    Raises
    ------
    DataError
        If the arrays do not belong together, a centre is not finite, or the proximity is not a
        finite number from 0 on.
    """
    classes, centres = _checked(classes, centres_px)
    if not 0 <= proximity_px < np.inf:
        raise DataError(f"proximity_px must be a finite number from 0 on, not {proximity_px}")
    # float64, so that the limit is compared exactly whenever centres are multiples of half a pixel
    places = centres.astype(np.float64)
    first, second = _candidates(places, proximity_px)
    gap = places[first] - places[second]  # (k, 2)
    squared = gap[:, 0] * gap[:, 0] + gap[:, 1] * gap[:, 1]  # (k,)
    close = np.flatnonzero(squared <= proximity_px * proximity_px)  # (m,)
    edges = np.empty((len(close), 2), dtype=np.int64)
    edges[:, 0] = first[close]
    edges[:, 1] = second[close]
    lengths = np.sqrt(squared[close]).astype(np.float32)
    return SceneGraph(classes=classes, centres_px=centres, edges=edges, lengths_px=lengths)


def _checked(classes: NDArray[Any], centres_px: NDArray[Any]) -> tuple[Ints, NDArray[np.float32]]:
    classes, centres_px = np.asarray(classes), np.asarray(centres_px)
    if classes.size == 0 and centres_px.size == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32)
    if classes.ndim != 1 or not np.issubdtype(classes.dtype, np.integer):
        raise DataError(f"classes must be (n,) integers, not {classes.shape} {classes.dtype}")
    if centres_px.shape != (len(classes), 2):
        raise DataError(f"each object needs a class and a centre: {classes.shape} classes, {centres_px.shape} centres")
    centres = np.array(centres_px, dtype=np.float32)
    if not np.isfinite(centres).all():
        row = int(np.flatnonzero(~np.isfinite(centres).all(axis=1))[0])
        raise DataError(f"the centre of object {row} is not finite: {centres[row].tolist()}")
    return np.array(classes, dtype=np.int64), centres


def _candidates(places: NDArray[np.float64], proximity_px: float) -> tuple[Ints, Ints]:
    """Return pairs in ascending order, among them all that are close enough."""
    if len(places) <= _ALL_PAIRS_UP_TO:
        return _all_pairs(len(places))
    # A hair wider than asked: the caller applies the one exact comparison to both kinds of candidates.
    pairs = cKDTree(places).query_pairs(np.nextafter(proximity_px, np.inf) * (1 + 1e-9), output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]  # (k, 2)
    return pairs[:, 0], pairs[:, 1]


@lru_cache(maxsize=_ALL_PAIRS_UP_TO + 1)
def _all_pairs(count: int) -> tuple[Ints, Ints]:
    first, second = np.triu_indices(count, k=1)
    return first, second


def object_keys(graph: SceneGraph) -> Ints:
    """Write objects as whole numbers: class, row and column in half pixels, ``(n, 3)``.

    Raises
    ------
    DataError
        If a centre is not finite or further away than 2³¹ half pixels.
    """
    halves = np.rint(graph.centres_px.astype(np.float64) * 2)  # (n, 2)
    if not (np.abs(halves) < _BEYOND_ALL_PICTURES).all():  # false for nan as well
        raise DataError("a scene has an object whose centre is not finite or beyond all pictures")
    return np.column_stack([graph.classes, halves.astype(np.int64)])
