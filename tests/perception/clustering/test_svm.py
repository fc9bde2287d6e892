"""A support vector machine that learns the classes of another clusterer."""

import numpy as np
import pytest
from sklearn.svm import SVC

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering.birch import Birch, BirchConfig
from semrl.perception.clustering.kmeans import KMeans, KMeansConfig
from semrl.perception.clustering.som import SelfOrganisingMap
from semrl.perception.clustering.svm import SVMClassifier, SVMConfig

CENTRES = np.random.default_rng(3).normal(size=(14, 10)) * 1.5


def objects(n, seed):
    """Rows of fourteen kinds, some of them rare, as objects are."""
    rng = np.random.default_rng(seed)
    shares = 0.8 ** np.arange(14)
    return CENTRES[rng.choice(14, size=n, p=shares / shares.sum())] + 0.1 * rng.normal(size=(n, 10))


def learn(box, X, size=100):
    for start in range(0, len(X), size):
        box.partial_fit(X[start : start + size])
    return box


@pytest.mark.parametrize(
    "teacher",
    [
        Birch,
        lambda: KMeans(KMeansConfig(start_rows=500)),
        SelfOrganisingMap,
        lambda: Birch(BirchConfig(threshold=0.2, max_classes=6)),
    ],
    ids=["birch", "kmeans", "som", "few classes"],
)
@pytest.mark.parametrize("features", [0, 256])
def test_it_agrees_with_its_teacher_on_fresh_rows(teacher, features):
    box = learn(SVMClassifier(SVMConfig(features=features), teacher()), objects(6_000, 0))
    fresh = objects(2_000, 1)
    expected = box.teacher.predict(fresh)
    assert len(np.unique(expected)) > 5
    assert (box.predict(fresh) == expected).mean() >= 0.95
    np.testing.assert_array_equal(box.classes_, box.teacher.classes_)
    np.testing.assert_array_equal(box.centres_, box.teacher.centres_)
    assert box.n_clusters_ == box.teacher.n_clusters_


def ring(n, seed):
    """A disc and a ring around it: no plane parts them."""
    rng = np.random.default_rng(seed)
    angle, outside = rng.uniform(0, 2 * np.pi, size=n), rng.random(n) < 0.5
    radius = np.where(outside, 3, 0) + rng.uniform(0, 0.8, size=n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), outside.astype(np.int64)


class Radius:
    """A teacher that knows disc and ring."""

    revision = object()
    is_fitted, n_clusters_, classes_, centres_ = True, 2, np.arange(2), np.zeros((2, 2))

    def partial_fit(self, X):
        return self

    def predict(self, X):
        return (np.linalg.norm(X, axis=1) > 1.5).astype(np.int64)

    def to_arrays(self):
        return {}

    def from_arrays(self, arrays):
        pass


def test_fourier_features_part_what_no_plane_parts():
    X, which = ring(3_000, 0)
    fresh, truth = ring(1_000, 1)
    found = {n: learn(SVMClassifier(SVMConfig(features=n), Radius()), X).predict(fresh) for n in (0, 256)}
    assert (found[0] == truth).mean() < 0.8
    assert (found[256] == truth).mean() > 0.98
    exact = SVC(gamma=0.5).fit(X, which).predict(fresh)  # the kernel that they approximate at a width of 1
    assert (found[256] == exact).mean() > 0.98


@pytest.mark.parametrize("width", [0.7, 2.0])
def test_products_of_features_approximate_the_kernel(width):
    box = SVMClassifier(SVMConfig(features=4_000, width=width)).partial_fit(objects(1, 0))
    arrays = {key.removeprefix("svm/"): array for key, array in box.to_arrays().items()}
    rows = np.random.default_rng(0).normal(size=(20, 10)) * 0.5
    features = np.sqrt(2 / 4_000) * np.cos(rows @ arrays["frequencies"] + arrays["phases"])
    kernel = np.exp(-np.square(rows[:, None] - rows).sum(axis=2) / (2 * width**2))
    np.testing.assert_allclose(features @ features.T, kernel, atol=0.08)


def test_it_predicts_without_its_teacher():
    box = learn(SVMClassifier(), objects(1_500, 0))
    fresh = objects(200, 1)
    expected = box.predict(fresh)
    box.teacher.predict = lambda X: pytest.fail("the teacher was asked")
    np.testing.assert_array_equal(box.predict(fresh), expected)


def test_the_teacher_learns_with_it_and_is_saved_with_it():
    alone, taught, restored = Birch(), SVMClassifier(), SVMClassifier()
    learn(alone, objects(600, 0))
    learn(taught, objects(600, 0))
    restored.from_arrays(taught.to_arrays())
    for box in (taught, restored):
        assert digest(box.teacher.to_arrays()) == digest(alone.to_arrays())


def test_a_teacher_with_too_many_classes_is_refused():
    box = SVMClassifier(SVMConfig(max_classes=4), KMeans(KMeansConfig(max_classes=9)))
    with pytest.raises(DataError, match="max_classes = 4"):
        box.partial_fit(objects(100, 0))
    with pytest.raises(DataError, match="other features or classes"):
        SVMClassifier(SVMConfig(features=8)).from_arrays(learn(SVMClassifier(), objects(60, 0)).to_arrays())


@pytest.mark.parametrize(
    "values",
    [
        {"max_classes": 1},
        {"epochs": 0},
        {"features": -1},
        {"width": 0.0},
        {"penalty": 0.0},
        {"learning_rate": -1.0},
        {"seed": -1},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError):
        SVMConfig(**values)
