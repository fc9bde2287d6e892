"""A clusterer: the leader algorithm. What is far from all leaders so far becomes the leader of a new class."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from semrl.core import Floats, Ints
from semrl.core.arrays import Arrays


@dataclass(frozen=True, kw_only=True)
class LeaderConfig:
    """How many classes, and how wide they are."""

    radius: float = 0.5
    """Farthest from its leader that an object of a class may be."""
    max_classes: int = 10
    """Most classes; what comes later joins the nearest."""


class LeaderClusterer:
    """Keeps the first object of each class."""

    Config = LeaderConfig

    def __init__(self, config: LeaderConfig) -> None:
        self.config = config
        self.revision = object()
        self.centres_ = np.zeros((0, 0))

    is_fitted = property(lambda self: len(self.centres_) > 0)
    n_clusters_ = property(lambda self: len(self.centres_))
    classes_ = property(lambda self: np.arange(len(self.centres_)))

    def partial_fit(self, X: Floats) -> Self:
        """Learn from ``(n, d)`` objects, one after the other."""
        for row in np.asarray(X, np.float64):
            near = len(self.centres_) and self._distances(row[None]).min() <= self.config.radius
            if not near and len(self.centres_) < self.config.max_classes:
                self.centres_ = np.vstack([self.centres_.reshape(-1, len(row)), row])
                self.revision = object()
        return self

    def predict(self, X: Floats) -> Ints:
        """Return the class of the nearest leader, ``(n,)``."""
        return self._distances(np.asarray(X)).argmin(axis=1)

    def to_arrays(self) -> Arrays:
        """Return the leaders."""
        return {"centres": self.centres_}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over leaders."""
        self.centres_, self.revision = arrays["centres"], object()

    def _distances(self, X: Floats) -> Floats:
        return np.linalg.norm(X[:, None] - self.centres_[None], axis=2)
