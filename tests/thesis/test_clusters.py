import numpy as np
import pytest
from sklearn.decomposition import PCA

from semrl.perception.reduction import ObjectPCA, PCAConfig
from semrl_thesis.clusters import explained_variance


def test_explained_variance_of_what_was_learned_from_is_that_of_pca():
    rows = np.random.default_rng(0).normal(size=(200, 6)).astype(np.float32) * [5, 3, 2, 1, 1, 0.5]
    pca = ObjectPCA(PCAConfig(components=6)).partial_fit(rows)
    shares = explained_variance(pca, rows)
    np.testing.assert_allclose(shares, PCA(6).fit(rows).explained_variance_ratio_.cumsum(), atol=1e-5)
    assert shares[-1] == pytest.approx(1, abs=1e-6)


def test_explained_variance_of_something_else_is_less():
    rng = np.random.default_rng(0)
    pca = ObjectPCA(PCAConfig(components=2)).partial_fit(rng.normal(size=(100, 4)) * [9, 9, 1, 1])
    assert explained_variance(pca, rng.normal(size=(100, 4)) * [1, 1, 9, 9])[-1] < 0.1
