"""A support vector machine that learns the classes of another clusterer, and then tells kinds apart by itself (§1)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import DataError, UsageError
from semrl.core.kernels import compiled
from semrl.perception.clustering.birch import Birch
from semrl.perception.clustering.protocol import Clusterer
from semrl.perception.clustering.rows import checked_rows

if TYPE_CHECKING:
    from sklearn.linear_model import SGDClassifier

_SAVED = ("planes", "offsets", "steps", "frequencies", "phases")


@dataclass(frozen=True, kw_only=True, slots=True)
class SVMConfig:
    """Parameters of `SVMClassifier`."""

    max_classes: int = 10
    """Most classes of the teacher, whose numbers go from 0 to max_classes − 1."""
    features: int = 256
    """Random Fourier features, whose products approximate a Gaussian kernel; 0 for a linear machine."""
    width: float = 1.0
    """Standard deviation of that kernel, in units of the reduced objects."""
    penalty: float = 1e-5
    """Weight of the margin against the hinge loss."""
    learning_rate: float = 0.5
    """Step size of stochastic gradient descent."""
    epochs: int = 1
    """Passes over each batch."""
    seed: int = 0
    """Of the features and of the order of rows."""

    def __post_init__(self) -> None:
        if self.max_classes < 2 or self.epochs < 1:
            raise UsageError("max_classes must be 2 or more, epochs 1 or more")
        if self.features < 0 or self.seed < 0:
            raise UsageError("features and seed must be 0 or more")
        if not (self.width > 0 and self.penalty > 0 and self.learning_rate > 0):
            raise UsageError("width, penalty and learning_rate must be above 0")


class SVMClassifier:
    """One machine for each class against all others, with the classes of a teacher as truth.

    Each batch is first learned by the teacher. What class it then gives each row is learned by stochastic gradient
    descent on the hinge loss, of features whose products approximate a Gaussian kernel (Rahimi & Recht, "Random
    features for large-scale kernel machines", NIPS 2007). `predict` asks the machines alone, among the
    classes that the teacher has.

    Parameters
    ----------
    config
        See `SVMConfig`.
    teacher
        Whose classes are learned; `Birch` with its defaults when None. It learns with this one, and is saved with it.

    Attributes
    ----------
    revision : object
        Another one whenever what `predict` returns may have changed.

    Examples
    --------
    >>> import numpy as np
    >>> svm = SVMClassifier(teacher=Birch())
    >>> for _ in range(5):
    ...     _ = svm.partial_fit(np.array([[0.0, 0.0], [5.0, 5.0]]))
    >>> svm.predict(np.array([[4.9, 5.0], [0.0, 0.1]]))
    array([1, 0])
    """

    def __init__(self, config: SVMConfig | None = None, teacher: Clusterer | None = None) -> None:
        self.config = config or SVMConfig()
        self.teacher: Clusterer = teacher or Birch()
        self.revision = object()
        self._frequencies = np.zeros((0, 0))  # (d, features)
        self._phases = np.zeros(0)  # (features,)
        self._svm = self._new()

    @property
    def is_fitted(self) -> bool:
        """Whether anything was learned."""
        return hasattr(self._svm, "coef_")

    @property
    def n_clusters_(self) -> int:
        """How many clusters the teacher joined to classes."""
        return self.teacher.n_clusters_

    @property
    def classes_(self) -> Ints:
        """The class numbers in use, ``(k,)`` int64, ascending: the teacher's."""
        return self.teacher.classes_

    @property
    def centres_(self) -> NDArray[np.float64]:
        """The middle of each of `classes_` as the teacher has it, ``(k, d)`` float64, in the reduced space."""
        return self.teacher.centres_

    def partial_fit(self, X: NDArray[Any]) -> Self:
        """Let the teacher learn from ``(n, d)`` rows, then learn which it gives them."""
        rows = checked_rows(X, len(self._frequencies))
        self.teacher.partial_fit(rows)
        self.revision = object()
        if not len(rows):
            return self
        if not self.is_fitted:
            self._draw_features(rows.shape[1])
        classes = self.teacher.predict(rows)
        numbers = np.arange(self.config.max_classes)
        if classes.max() >= len(numbers):
            raise DataError(f"the teacher has more than max_classes = {len(numbers)} classes")
        features = self._features(rows)
        for _ in range(self.config.epochs):
            self._svm.partial_fit(features, classes, classes=numbers)
        return self

    def predict(self, X: NDArray[Any]) -> Ints:
        """Return the class whose machine is surest of each of ``(n, d)`` rows, ``(n,)`` int64; learns nothing."""
        if not self.is_fitted:
            raise DataError("the machines know no class yet: call partial_fit first")
        numbers = self.classes_
        features = self._features(checked_rows(X, len(self._frequencies)))
        planes = np.ascontiguousarray(self._svm.coef_[numbers].T)
        classes: Ints = numbers[(_products(features, planes) + self._svm.intercept_[numbers]).argmax(axis=1)]
        return classes

    def to_arrays(self) -> Arrays:
        """Return teacher and machines; one restored from them goes on bit for bit as this one does."""
        own: Arrays = {}
        if self.is_fitted:
            own = {"planes": self._svm.coef_.copy(), "offsets": self._svm.intercept_.copy()}
            own |= {"steps": np.array(self._svm.t_)}
            own |= {"frequencies": self._frequencies.copy(), "phases": self._phases.copy()}
        return nest(teacher=self.teacher.to_arrays(), svm=own)

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` of an equally configured one, with such a teacher, returned."""
        saved, svm = unnest(arrays, "svm"), self._new()
        if saved and (missing := set(_SAVED) - saved.keys()):
            raise DataError(f"the saved machines lack {', '.join(sorted(missing))}")
        frequencies, phases = (saved[name].copy() if saved else np.zeros((0, 0)) for name in _SAVED[3:])
        if saved:
            width = self.config.features or len(frequencies)
            if saved["planes"].shape != (self.config.max_classes, width) or phases.shape != (self.config.features,):
                raise DataError("the saved machines are for other features or classes")
            svm.classes_, svm.n_features_in_ = np.arange(self.config.max_classes), width
            svm.coef_, svm.intercept_ = saved["planes"].copy(), saved["offsets"].copy()
            svm.t_ = float(saved["steps"])
        self.teacher.from_arrays(unnest(arrays, "teacher"))
        self._svm, self._frequencies, self._phases = svm, frequencies, phases.ravel()
        self.revision = object()

    def _new(self) -> "SGDClassifier":
        from sklearn.linear_model import SGDClassifier

        return SGDClassifier(
            loss="hinge",
            alpha=self.config.penalty,
            learning_rate="constant",
            eta0=self.config.learning_rate,
            random_state=self.config.seed,
        )

    def _draw_features(self, dimension: int) -> None:
        """Draw the frequencies of a Gaussian kernel, and phases."""
        rng = np.random.default_rng(self.config.seed)
        self._frequencies = rng.normal(size=(dimension, self.config.features)) / self.config.width
        self._phases = rng.uniform(0, 2 * np.pi, size=self.config.features)

    def _features(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the machines see of ``(n, d)`` rows: ``(n, features)`` of length about 1, or the rows."""
        if not self.config.features:
            return rows
        waves = np.cos(_products(rows, self._frequencies) + self._phases)
        return np.asarray(np.sqrt(2 / self.config.features) * waves)


@compiled
def _products(A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``A @ B`` with each sum in its order, so that a row's class does not depend on the other rows."""
    found = np.zeros((len(A), B.shape[1]))
    for i in range(len(A)):
        for j in range(len(B)):
            for k in range(B.shape[1]):
                found[i, k] += A[i, j] * B[j, k]
    return found
