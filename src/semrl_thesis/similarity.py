"""How good an embedding is (§4.1.3): does the most similar vector belong to a scene that is near?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, SceneGraph
from semrl.core.errors import DataError
from semrl.perception.embedding.protocol import Embedder
from semrl_thesis.graph_distance import graph_distances, nearest_graphs

_BLOCK = 1 << 24
"""Similarities computed at once."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Retrieval:
    """What was found for each of ``q`` scenes.

    Attributes
    ----------
    places
        ``(q,)`` int64, place of the scene that was found among those that were searched.
    distances
        ``(q,)`` float64, graph distance to it.
    """

    places: Ints
    distances: NDArray[np.float64]

    def within(self, distance: float) -> float:
        """Return the share of the scenes that found one nearer than this graph distance."""
        return float(np.mean(self.distances < distance))


def embed(embedder: Embedder, graphs: Sequence[SceneGraph]) -> Floats:
    """Return the vectors of scenes, ``(n, dimension)`` float32."""
    vectors = np.zeros((len(graphs), embedder.dimension), np.float32)
    for i, graph in enumerate(graphs):
        vectors[i] = embedder.transform(graph)
    return vectors


def learned_vectors(embedder: Embedder, graphs: Sequence[SceneGraph]) -> Floats:
    """Return the vectors of the scenes of `fit`: those learned with it, as doc2vec does, else new ones."""
    learned = getattr(embedder, "document_vectors_", None)
    return embed(embedder, graphs) if learned is None else learned


def cosine_similarities(first: Floats, second: Floats) -> NDArray[np.float64]:
    """Return the cosine of each row with the row at the same place, ``(n,)``; 0 for a row of zeros."""
    return np.asarray((_unit(first) * _unit(second)).sum(axis=1), dtype=np.float64)


def most_similar(queries: Floats, vectors: Floats) -> Ints:
    """Return for each of ``(q, d)`` rows the place of the most similar of ``(n, d)`` rows by cosine, ``(q,)`` int64.

    Raises
    ------
    DataError
        If there is nothing to search.
    """
    if not len(vectors):
        raise DataError("there are no vectors to search")
    searched = _unit(vectors).T
    rows = max(1, _BLOCK // len(vectors))
    found = [(_unit(queries[start : start + rows]) @ searched).argmax(axis=1) for start in range(0, len(queries), rows)]
    return np.concatenate([np.zeros(0, np.int64), *found])


def retrieve(
    queries: Floats, query_graphs: Sequence[SceneGraph], vectors: Floats, graphs: Sequence[SceneGraph]
) -> Retrieval:
    """Find for each scene the one with the most similar vector, and tell how near that is.

    Parameters
    ----------
    queries, query_graphs
        ``(q, d)`` vectors and their scenes.
    vectors, graphs
        ``(n, d)`` vectors to search and their scenes.
    """
    places = most_similar(queries, vectors)
    return Retrieval(places=places, distances=graph_distances(query_graphs, [graphs[place] for place in places]))


def search(query_graphs: Sequence[SceneGraph], graphs: Sequence[SceneGraph]) -> Retrieval:
    """Find for each scene the nearest one itself: no embedding can do better."""
    places, distances = nearest_graphs(query_graphs, graphs)
    return Retrieval(places=places, distances=distances)


def _unit(rows: Floats) -> Floats:
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / np.where(lengths > 0, lengths, 1), dtype=np.float32)
