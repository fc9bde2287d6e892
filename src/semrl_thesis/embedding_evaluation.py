"""What a vector of a scene is good for, measured: near scenes found, distances kept, positions read off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.perception.embedding.protocol import Embedder
from semrl_thesis.graph_distance import graph_distances
from semrl_thesis.similarity import (
    Retrieval,
    cosine_similarities,
    embed,
    learned_vectors,
    retrieve,
    search,
)
from semrl_thesis.watching import COORDINATES, Watched

NEAR_PX = 5.0
"""Graph distance below which a scene that was found counts as near (§4.1.3)."""


RIDGE = 0.01
"""What a weight of 1 costs a linear probe, in squared errors."""


@dataclass(frozen=True, kw_only=True)
class Evaluator:
    """Scenes to learn from and scenes of new episodes, the same for all embeddings.

    Attributes
    ----------
    documents
        Scenes to learn from and to search.
    validation
        Scenes that are sought among them.
    best
        What a search by graph distance finds.
    distances
        Graph distance of each of `validation.adjacent` to the scene after it.
    """

    documents: Watched
    validation: Watched
    best: Retrieval
    distances: NDArray[np.float64]

    def evaluator(self, embedder: Embedder) -> dict[str, float]:
        """Measure an embedding that has learned.

        Returns
        -------
        ``ratio``, how often it finds a scene nearer than 5, as a share of how often there is one; ``pearson``, of
        cosine similarity and graph distance of adjacent frames; ``r2-…``, the R² of a linear function of the vector,
        fitted on the documents, for each coordinate, on new frames on which the ball is visible.
        """
        stored = learned_vectors(embedder, self.documents.scenes)
        vectors = embed(embedder, self.validation.scenes)
        found = retrieve(vectors, self.validation.scenes, stored, self.documents.scenes)
        here = self.validation.adjacent
        similarities = cosine_similarities(vectors[here], vectors[here + 1])
        return {
            "ratio": found.within(NEAR_PX) / max(self.best.within(NEAR_PX), 1e-9),
            "pearson": float(np.corrcoef(similarities, self.distances)[0, 1]) if similarities.std() else float("nan"),
            **self._probe(stored, vectors),
        }

    def _probe(self, stored: Floats, vectors: Floats) -> dict[str, float]:
        seen, new = self.documents.ball_visible, self.validation.ball_visible
        known = _with_one(stored[seen]).astype(np.float64)
        # Directions in which scenes hardly differ would be blown up by the rare scenes that do.
        products = known.T @ known + RIDGE * np.eye(known.shape[1])
        weights = np.linalg.solve(products, known.T @ self.documents.coordinates[seen])
        truth = self.validation.coordinates[new]
        missed = truth - _with_one(vectors[new]) @ weights
        total = np.maximum(truth.var(axis=0) * len(truth), 1e-9)
        shares = 1 - (missed**2).sum(axis=0) / total
        return {f"r2-{name.replace('_', '-')}": float(r2) for name, r2 in zip(COORDINATES, shares, strict=True)}


def call_judge(documents: Watched, validation: Watched) -> Evaluator:
    """Make ready what all embeddings are measured by."""
    here = validation.adjacent
    return Evaluator(
        documents=documents,
        validation=validation,
        best=search(validation.scenes, documents.scenes),
        distances=graph_distances(
            [validation.scenes[place] for place in here], [validation.scenes[place + 1] for place in here]
        ),
    )


def _with_one(vectors: Floats) -> NDArray[np.float64]:
    """Return rows for a linear function with an offset."""
    return np.column_stack([vectors, np.ones(len(vectors))]).astype(np.float64)
