"""How far two scenes are apart, object by object: what an embedding is measured against (§4.1.3).

The thesis's formula: with A the scene of fewer objects,

    Σ_{a ∈ A} min_{b ∈ B} (dist(a, b) + class(a, b) · class_penalty) + (|B| − |A|) · number_penalty

where dist is the Euclidean distance of two centres and class is 1 for objects of different classes, else 0.
Of two scenes with equally many objects A is the first, so that such a distance may depend on the order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints, SceneGraph
from semrl.core.errors import DataError, UsageError
from semrl.core.kernels import compiled


@dataclass(frozen=True, kw_only=True, slots=True)
class GraphDistanceConfig:
    """What else counts beside positions, in pixels; the thesis's values (§4.1.3)."""

    class_penalty: float = 100.0
    """Added to the distance of two objects of different classes."""

    number_penalty: float = 100.0
    """Added for each object that one scene has more than the other."""

    def __post_init__(self) -> None:
        if not (0 <= self.class_penalty < np.inf and 0 <= self.number_penalty < np.inf):
            raise UsageError("class_penalty and number_penalty must be finite numbers from 0 on")


class _Packed(NamedTuple):
    """Scenes one after the other: scene i has the objects from ``starts[i]`` to ``starts[i + 1]``."""

    classes: Ints
    centres: NDArray[np.float64]
    starts: Ints


def graph_distance(first: SceneGraph, second: SceneGraph, config: GraphDistanceConfig | None = None) -> float:
    """Return how far two scenes are apart, from 0 on, in pixels and penalties (§4.1.3)."""
    return float(graph_distances([first], [second], config)[0])


def graph_distances(
    first: Sequence[SceneGraph], second: Sequence[SceneGraph], config: GraphDistanceConfig | None = None
) -> NDArray[np.float64]:
    """Return the distance of each scene to the one at the same place, ``(n,)``.

    Raises
    ------
    DataError
        If there are not equally many of both.
    """
    if len(first) != len(second):
        raise DataError(f"expected pairs of scenes, not {len(first)} and {len(second)} of them")
    config = config or GraphDistanceConfig()
    return _pairwise(_pack(first), _pack(second), (config.class_penalty, config.number_penalty))


def nearest_graphs(
    queries: Sequence[SceneGraph], graphs: Sequence[SceneGraph], config: GraphDistanceConfig | None = None
) -> tuple[Ints, NDArray[np.float64]]:
    """Find for each scene the nearest of many, by comparing it with all of them.

    Parameters
    ----------
    queries
        ``q`` scenes; each is the first of a pair.
    graphs
        ``n`` scenes to search, at least one.
    config
        What counts beside positions.

    Returns
    -------
    places
        ``(q,)`` int64, the first of the nearest.
    distances
        ``(q,)`` float64, how far each is.

    Raises
    ------
    DataError
        If there is nothing to search.
    """
    if not graphs:
        raise DataError("there are no scenes to search")
    config = config or GraphDistanceConfig()
    return _nearest(_pack(queries), _pack(graphs), (config.class_penalty, config.number_penalty))


def _pack(graphs: Sequence[SceneGraph]) -> _Packed:
    return _Packed(
        classes=np.concatenate([np.zeros(0, np.int64), *(graph.classes for graph in graphs)]),
        centres=np.concatenate([np.zeros((0, 2)), *(graph.centres_px for graph in graphs)]),
        starts=np.cumsum([0, *map(len, graphs)]),
    )


@compiled
def _pairwise(first: _Packed, second: _Packed, penalties: tuple[float, float]) -> NDArray[np.float64]:
    distances = np.empty(len(first.starts) - 1)
    for i in range(len(distances)):
        distances[i] = _distance((first, i), (second, i), penalties, np.inf)
    return distances


@compiled
def _nearest(queries: _Packed, graphs: _Packed, penalties: tuple[float, float]) -> tuple[Ints, NDArray[np.float64]]:
    n_queries, n_graphs = len(queries.starts) - 1, len(graphs.starts) - 1
    places = np.zeros(n_queries, np.int64)
    distances = np.full(n_queries, np.inf)
    for i in range(n_queries):
        for j in range(n_graphs):
            distance = _distance((queries, i), (graphs, j), penalties, distances[i])
            if distance < distances[i]:
                places[i], distances[i] = j, distance
    return places, distances


@compiled
def _distance(
    first: tuple[_Packed, int], second: tuple[_Packed, int], penalties: tuple[float, float], bound: float
) -> float:
    """Return the distance of two scenes, or a partial sum of it that has reached `bound`."""
    n_first, n_second = _size(first), _size(second)
    (few, k), many = (first, second) if n_first <= n_second else (second, first)
    class_penalty, number_penalty = penalties
    total: float = number_penalty * abs(n_first - n_second)
    for a in range(few.starts[k], few.starts[k + 1]):
        if total >= bound:
            break
        total += _to_nearest_object(few.classes[a], few.centres[a], many, class_penalty)
    return total


@compiled
def _size(scene: tuple[_Packed, int]) -> int:
    scenes, i = scene
    return scenes.starts[i + 1] - scenes.starts[i]  # type: ignore[no-any-return]


@compiled
def _to_nearest_object(
    number: int, centre: NDArray[np.float64], scene: tuple[_Packed, int], class_penalty: float
) -> float:
    """Return min over b of dist(a, b) + class(a, b) · penalty; roots are drawn at the end only."""
    scenes, i = scene
    alike, unlike = np.inf, np.inf  # squared distances to the nearest object of the same and of another class
    for b in range(scenes.starts[i], scenes.starts[i + 1]):
        squared = (scenes.centres[b, 0] - centre[0]) ** 2 + (scenes.centres[b, 1] - centre[1]) ** 2
        if scenes.classes[b] == number:
            if squared == 0:  # what stands still is met exactly
                return 0.0
            alike = min(alike, squared)
        else:
            unlike = min(unlike, squared)
    return float(min(np.sqrt(alike), np.sqrt(unlike) + class_penalty))
