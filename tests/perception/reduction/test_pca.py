"""Incremental PCA: scikit-learn's, on the unique rows of each batch."""

import numpy as np
import pytest
from sklearn.decomposition import IncrementalPCA

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.envs import Game, make_env
from semrl.perception.detection import OtsuDetector
from semrl.perception.detection.grey import to_grey
from semrl.perception.reduction import ObjectPCA, PCAConfig


def batches(n, rows=30, d=64, seed=0):
    rng = np.random.default_rng(seed)
    mix = rng.normal(size=(d, d)) * np.linspace(3, 0.1, d)[:, None]
    return [(rng.normal(size=(rows, d)) @ mix).astype(np.float32) for _ in range(n)]


def test_it_is_scikit_learns():
    ours, theirs = ObjectPCA(), IncrementalPCA(n_components=10)
    data = batches(8)
    for X in data:
        ours.partial_fit(X)
        theirs.partial_fit(np.unique(X.astype(np.float64), axis=0))
    np.testing.assert_allclose(ours.transform(data[0]), theirs.transform(data[0]), atol=1e-4)
    np.testing.assert_allclose(ours.explained_variance_ratio_, theirs.explained_variance_ratio_, rtol=1e-6)
    np.testing.assert_allclose(
        ours.inverse_transform(ours.transform(data[0])), theirs.inverse_transform(theirs.transform(data[0])), atol=1e-4
    )


def test_equal_objects_count_once_a_batch():
    few, many = ObjectPCA(), ObjectPCA()
    for X in batches(4):
        few.partial_fit(X)
        many.partial_fit(np.concatenate([X, X[:7], X[:1].repeat(100, axis=0)]))
    assert digest(few.to_arrays()) == digest(many.to_arrays())


def test_rows_wait_until_there_are_as_many_as_components():
    X = batches(1)[0]
    pca = ObjectPCA()
    for start in range(0, 9, 3):
        pca.partial_fit(X[start : start + 3])
        assert not pca.is_fitted
        with pytest.raises(DataError, match="not seen 10 objects"):
            pca.transform(X)
    pca.partial_fit(X[9:13])
    assert pca.n_updates_ == 1
    theirs = IncrementalPCA(n_components=10).partial_fit(X[:13].astype(np.float64))
    np.testing.assert_allclose(np.abs(pca.transform(X)), np.abs(theirs.transform(X)), atol=1e-3)
    pca.partial_fit(X[13:16])
    assert pca.n_updates_ == 1
    pca.partial_fit(X[16:23])
    assert pca.n_updates_ == 2


@pytest.mark.parametrize("n_before", [0, 3, 10, 23])
def test_a_restored_pca_goes_on_bit_for_bit(n_before):
    """Also from a state in which rows wait: a batch of 4 rows is too small by itself."""
    data = [X[: 4 + 7 * (i % 2)] for i, X in enumerate(batches(40))]
    straight = ObjectPCA()
    for X in data[:n_before]:
        straight.partial_fit(X)
    saved = {name: array.copy() for name, array in straight.to_arrays().items()}
    restored = ObjectPCA()
    restored.partial_fit(batches(1, seed=5)[0])
    restored.from_arrays(saved)
    assert digest(restored.to_arrays()) == digest(saved)
    for X in data[n_before:]:
        straight.partial_fit(X)
        restored.partial_fit(X)
        if straight.is_fitted:
            np.testing.assert_array_equal(straight.transform(X), restored.transform(X))
    assert digest(restored.to_arrays()) == digest(straight.to_arrays())


def test_ten_numbers_describe_pongs_objects():
    game = Game(make_env("PongNoFrameskip-v4"), seed=0)
    game.reset()
    rng = np.random.default_rng(0)
    images = [to_grey(game.step(int(rng.integers(2))).observation.frame) for _ in range(150)]
    detector, pca = OtsuDetector(), ObjectPCA()
    for image in images:
        detector.partial_fit(image)
    features = [detector.detect(image).features for image in images]
    for X in features:
        pca.partial_fit(X)
    assert pca.explained_variance_ratio_.sum() > 0.95  # "enough to represent almost all variation" (§3.2.2)
    X = np.concatenate(features[-20:])
    error = np.abs(pca.inverse_transform(pca.transform(X)) - X).mean()
    assert error < 0.02
    assert np.abs(X.mean(axis=0) - X).mean() > 0.1  # what the mean object alone would miss


def test_no_rows_are_fine():
    pca = ObjectPCA().partial_fit(np.empty((0, 64)))
    assert not pca.is_fitted
    for X in batches(2):
        pca.partial_fit(X).partial_fit(X[:0])
    assert pca.n_updates_ == 2 and pca.transform(X[:0]).shape == (0, 10)


@pytest.mark.parametrize("bad", [np.full((2, 64), np.nan), np.full((2, 64), np.inf), np.zeros((2, 63)), np.zeros(64)])
def test_bad_rows_are_refused_and_not_learned(bad):
    waiting, fitted = ObjectPCA().partial_fit(batches(1)[0][:3]), ObjectPCA().partial_fit(batches(1)[0])
    for pca in (waiting, fitted):
        before = digest(pca.to_arrays())
        with pytest.raises(DataError):
            pca.partial_fit(bad)
        assert digest(pca.to_arrays()) == before
    with pytest.raises(DataError):
        fitted.transform(bad)


def test_too_many_components_are_refused():
    with pytest.raises(DataError, match="5 numbers do not fit 10 components"):
        ObjectPCA().partial_fit(np.ones((20, 5)))
    with pytest.raises(UsageError, match="components must be 1 or more"):
        PCAConfig(components=0)
