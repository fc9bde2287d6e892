"""A self-organising map: it comes closer to its rows, and its grid is laid out like them."""

import numpy as np
import pytest
from scipy.stats import spearmanr
from sklearn.cluster import AgglomerativeClustering

from semrl.core.errors import DataError, UsageError
from semrl.perception.clustering.som import SelfOrganisingMap, SelfOrganisingMapConfig


def quantisation_error(som, X):
    """The mean distance of a row from its best-matching unit."""
    units = som.units_.reshape(-1, X.shape[1])
    return float(np.linalg.norm(X[:, None] - units, axis=2).min(axis=1).mean())


def best_matching(som, X):
    """Row and column of the best-matching unit of each row."""
    distances = np.linalg.norm(X[:, None, None] - som.units_, axis=3)
    return np.stack(np.unravel_index(distances.reshape(len(X), -1).argmin(axis=1), distances.shape[1:]), axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_the_quantisation_error_falls(seed):
    rng = np.random.default_rng(seed)
    X = rng.uniform(size=(4_000, 2))
    som = SelfOrganisingMap(SelfOrganisingMapConfig(decay_rows=4_000, seed=seed))
    errors = [quantisation_error(som.partial_fit(batch), X) for batch in np.split(X, 4)]
    assert errors == sorted(errors, reverse=True)
    # 36 units on a square grid would be 0.38 / 6 away on average.
    assert errors[-1] < 0.09 < errors[0]


@pytest.mark.parametrize("seed", range(3))
def test_units_on_a_line_are_in_the_order_of_the_rows(seed):
    X = np.random.default_rng(seed).uniform(size=(4_000, 1)) * [[3.0, -1.0, 2.0]]  # a segment in space
    config = SelfOrganisingMapConfig(rows=1, columns=12, max_classes=3, decay_rows=3_000, seed=seed)
    som = SelfOrganisingMap(config).partial_fit(X)
    along = som.units_[0, :, 0]
    assert (np.diff(along) > 0).all() or (np.diff(along) < 0).all()
    assert abs(spearmanr(X[:, 0], best_matching(som, X)[:, 1]).statistic) > 0.99


def test_neighbours_in_a_square_are_neighbours_on_the_grid():
    X = np.random.default_rng(0).uniform(size=(6_000, 2))
    som = SelfOrganisingMap(SelfOrganisingMapConfig(decay_rows=5_000)).partial_fit(X)
    near = X[:1_000] + np.random.default_rng(1).normal(size=(1_000, 2)) * 0.02
    apart = np.abs(best_matching(som, X[:1_000]) - best_matching(som, near)).max(axis=1)
    assert (apart <= 1).mean() > 0.97


def test_one_row_pulls_every_unit_by_the_gaussian_of_its_distance_on_the_grid():
    config = SelfOrganisingMapConfig(rows=3, columns=4, learning_rate=0.4, radius=1.5, max_classes=2)
    som = SelfOrganisingMap(config)
    units = np.random.default_rng(0).normal(size=(12, 2))
    som.from_arrays({"units": units, "counts": np.ones(12), "classes": np.arange(12) % 2, "learned": np.array(0)})
    row = np.array([[0.3, -0.2]])
    winner = np.linalg.norm(units - row, axis=1).argmin()
    grid = np.stack(np.unravel_index(np.arange(12), (3, 4)), axis=1)
    shares = 0.4 * np.exp(-np.square(grid - grid[winner]).sum(axis=1) / (2 * 1.5**2))
    som.partial_fit(row)
    np.testing.assert_allclose(som.units_.reshape(12, 2), units + shares[:, None] * (row - units))


def test_the_pull_and_its_reach_fall_exponentially_and_then_stay():
    config = SelfOrganisingMapConfig(
        rows=1, columns=1, max_classes=1, learning_rate=0.8, final_learning_rate=0.2, decay_rows=4
    )
    som, unit = SelfOrganisingMap(config), 0.0
    som.from_arrays(
        {"units": np.zeros((1, 1)), "counts": np.ones(1), "classes": np.zeros(1, np.int64), "learned": np.array(0)}
    )
    for rate in (0.8, 0.8 / 2**0.5, 0.4, 0.2 * 2**0.5, 0.2, 0.2, 0.2):
        som.partial_fit(np.array([[1.0]]))
        unit += rate * (1 - unit)
        assert som.units_[0, 0, 0] == pytest.approx(unit)


def test_classes_are_ward_clusters_of_the_units_that_won():
    X = np.random.default_rng(0).normal(size=(3_000, 3))
    som = SelfOrganisingMap(SelfOrganisingMapConfig(max_classes=4, decay_rows=2_000)).partial_fit(X)
    arrays = som.to_arrays()
    won = arrays["counts"] > 0
    theirs = AgglomerativeClustering(n_clusters=4, linkage="ward").fit_predict(arrays["units"][won])
    ours = arrays["classes"][won]
    assert len({*zip(ours, theirs, strict=True)}) == 4 == len(som.classes_)
    assert som.n_clusters_ == won.sum()
    nearest = np.linalg.norm(X[:, None] - arrays["units"][won], axis=2).argmin(axis=1)
    np.testing.assert_array_equal(som.predict(X), ours[nearest])
    for number, centre in zip(som.classes_, som.centres_, strict=True):
        mine = arrays["classes"] == number
        expected = np.average(arrays["units"][mine], axis=0, weights=arrays["counts"][mine])
        np.testing.assert_allclose(centre, expected)


def test_another_seed_begins_elsewhere():
    X = np.random.default_rng(0).normal(size=(50, 3))
    one, again, other = (
        SelfOrganisingMap(SelfOrganisingMapConfig(seed=seed)).partial_fit(X).units_ for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(one, again)
    assert not np.allclose(one, other)


def test_there_are_no_units_before_the_first_row():
    with pytest.raises(DataError, match="partial_fit first"):
        _ = SelfOrganisingMap().units_


@pytest.mark.parametrize(
    "values",
    [
        {"rows": 0},
        {"decay_rows": 0},
        {"max_classes": 37},
        {"max_classes": 0},
        {"learning_rate": 1.5},
        {"final_learning_rate": 0.0},
        {"learning_rate": 0.1, "final_learning_rate": 0.2},
        {"radius": 0.1},
        {"final_radius": 0.0},
        {"radius": float("inf")},
        {"seed": -1},
    ],
)
def test_bad_parameters_are_refused(values):
    with pytest.raises(UsageError):
        SelfOrganisingMapConfig(**values)
