"""Figures of the embedding test: Figs. 4.7 – 4.11."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl_thesis.figures import Bars, Curve, Curves, Figure, Scatter
from semrl_thesis.similarity import Retrieval

SELF_FIGURES = {"pv-dm": "4.7", "pv-dbow": "4.8"}
"""Embeddings that the thesis draws searching their training set."""

SCATTER_POINTS = 1500
"""Points drawn in Fig. 4.11."""


@dataclass(frozen=True, kw_only=True)
class Validation:
    """How an embedding did on a new run.

    Attributes
    ----------
    found
        What it retrieved from the training set.
    best
        What a search by graph distance finds there.
    similarities, distances
        ``(n − 1,)``, cosine similarity and graph distance of adjacent frames.
    """

    found: Retrieval
    best: Retrieval
    similarities: NDArray[np.float64]
    distances: NDArray[np.float64]

    def pearson(self, start: int = 0) -> float | None:
        """Return the correlation of the two from a pair of frames on; None where one of them does not vary."""
        similarities, distances = self.similarities[start:], self.distances[start:]
        if not (similarities.std() > 0 and distances.std() > 0):
            return None
        return float(np.corrcoef(similarities, distances)[0, 1])


@dataclass(frozen=True, kw_only=True)
class EmbeddingTest:
    """What became of one candidate.

    Attributes
    ----------
    itself
        What scenes of the training set retrieved from it.
    sought
        ``(q,)``, which scenes these were.
    vocabulary
        Words it knows; None where that is no matter.
    validation
        None where it was left out.
    """

    itself: Retrieval
    sought: Ints
    vocabulary: int | None
    validation: Validation | None


def draw(tests: Mapping[str, EmbeddingTest]) -> tuple[Figure, ...]:
    """Draw Figs. 4.7 – 4.11 for all candidates."""
    validated = {name: test.validation for name, test in tests.items() if test.validation}
    return (
        *(_itself(number, name, tests[name]) for name, number in SELF_FIGURES.items() if name in tests),
        Figure(
            number="4.9",
            title="A new run searches the training set",
            says="Graph distance from each scene of the validation run to the training scene with the most similar "
            "vector.",
            panels=tuple((name, _histogram(test.found)) for name, test in validated.items()),
        ),
        Figure(
            number="4.10",
            title="What could have been found",
            says="Share of the validation run that found a scene nearer than so much: by embedding, and by comparing "
            "the graphs themselves, which no embedding can beat.",
            panels=tuple((name, _cumulative(test)) for name, test in validated.items()),
        ),
        Figure(
            number="4.11",
            title="Similar vectors, near graphs",
            says="Cosine similarity of adjacent frames against their graph distance, with the line of least squares.",
            panels=tuple((name, _correlation(test)) for name, test in validated.items()),
        ),
    )  # fmt: skip


def _itself(number: str, name: str, test: EmbeddingTest) -> Figure:
    return Figure(
        number=number,
        title=f"{name.upper()}: the training set searches itself",
        says=f"Graph distance from training scenes to the one that {name.upper()} finds most similar: it should be 0.",
        panels=((name, _histogram(test.itself)),),
    )


def _histogram(found: Retrieval) -> Bars:
    edges = (0, 1, 5, 20, 50, 100, 200, 300, np.inf)
    labels = ("<1", "<5", "<20", "<50", "<100", "<200", "<300", "more")
    counts, _ = np.histogram(found.distances, edges)
    return Bars(xlabel="graph distance", ylabel="scenes", labels=labels, heights=counts)


def _cumulative(test: Validation) -> Curves:
    at = np.arange(0, 301, 2.5)
    curves = (("by embedding", test.found), ("by graph distance", test.best))
    return Curves(
        xlabel="graph distance",
        ylabel="share of the run",
        curves=tuple(
            Curve(label=label, x=at, y=np.array([found.within(float(d)) for d in at])) for label, found in curves
        ),
    )


def _correlation(test: Validation) -> Scatter:
    x, y = test.similarities, test.distances
    slope, offset = np.polyfit(x, y, 1).tolist() if x.std() > 0 else (0.0, float(y.mean()))
    some = slice(None, None, -(-len(y) // SCATTER_POINTS))
    return Scatter(
        xlabel="cosine similarity",
        ylabel="graph distance",
        x=x[some],
        y=y[some],
        groups=np.zeros(len(y[some]), np.int64),
        weights=np.ones(len(y[some])),
        line=(slope, offset),
    )
