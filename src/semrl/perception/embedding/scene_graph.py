"""The scene graph (§3.2.3, Fig. 3.6): objects are nodes, objects close to each other are joined."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, SceneGraph
from semrl.core.errors import DataError, UsageError
from semrl.core.kernels import compiled

FARTHEST_PX = 1e6
"""Largest coordinate of a centre."""


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
        If the arrays do not belong together, a centre is not finite or farther than `FARTHEST_PX`, or the
        proximity is not a finite number from 0 on.
    """
    classes, centres = _checked(classes, centres_px)
    if not 0 <= proximity_px < np.inf:
        raise DataError(f"proximity_px must be a finite number from 0 on, not {proximity_px}")
    edges, lengths = _edges(centres, proximity_px)
    return SceneGraph(classes=classes, centres_px=centres, edges=edges, lengths_px=lengths)


def _checked(classes: NDArray[Any], centres_px: NDArray[Any]) -> tuple[Ints, Floats]:
    classes, centres_px = np.asarray(classes), np.asarray(centres_px)
    if classes.size == 0 and centres_px.size == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32)
    if classes.ndim != 1 or not np.issubdtype(classes.dtype, np.integer):
        raise DataError(f"classes must be (n,) integers, not {classes.shape} {classes.dtype}")
    if centres_px.shape != (len(classes), 2):
        raise DataError(f"each object needs a class and a centre: {classes.shape} classes, {centres_px.shape} centres")
    centres = np.array(centres_px, dtype=np.float32)
    _check_places(centres)
    return np.array(classes, dtype=np.int64), centres


def _check_places(centres: Floats) -> None:
    near = (np.abs(centres) <= FARTHEST_PX).all(axis=1)  # false for NaN too
    if not near.all():
        far = int(near.argmin())
        raise DataError(f"the centre of object {far} is not finite or too far away: {centres[far].tolist()}")


def object_keys(graph: SceneGraph) -> Ints:
    """Write objects as whole numbers: class, row and column in half pixels, ``(n, 3)``.

    Raises
    ------
    DataError
        If a centre is not finite or further away than `FARTHEST_PX`.
    """
    _check_places(graph.centres_px)
    return np.column_stack([graph.classes, np.rint(graph.centres_px * np.float32(2)).astype(np.int64)])


@compiled
def _edges(centres: Floats, proximity_px: float) -> tuple[Ints, Floats]:
    """Compare all pairs; return those that are close enough in ascending order, and their distances."""
    n, limit = len(centres), proximity_px * proximity_px
    count = 0
    for i in range(n):
        for j in range(i + 1, n):
            count += _squared_distance(centres, i, j) <= limit
    edges, lengths = np.empty((count, 2), np.int64), np.empty(count, np.float32)
    m = 0
    for i in range(n):
        for j in range(i + 1, n):
            squared = _squared_distance(centres, i, j)
            if squared <= limit:
                edges[m, 0], edges[m, 1] = i, j
                lengths[m] = np.sqrt(squared)
                m += 1
    return edges, lengths


@compiled
def _squared_distance(centres: Floats, i: int, j: int) -> float:
    # float64, so that the limit is compared exactly whenever centres are multiples of half a pixel
    rows = np.float64(centres[i, 0]) - np.float64(centres[j, 0])
    columns = np.float64(centres[i, 1]) - np.float64(centres[j, 1])
    return float(rows * rows + columns * columns)
