import numpy as np
import pytest
from scipy.stats import trim_mean

from semrl.evaluation.statistics import interquartile_mean, performance_profile


def test_interquartile_mean_and_its_interval():
    rng = np.random.default_rng(0)
    runs = [rng.normal(size=10), rng.normal(size=10) + 3]
    mean, low, high = interquartile_mean(runs)
    assert mean == pytest.approx(trim_mean(np.concatenate(runs), 0.25))
    assert low < mean < high
    assert interquartile_mean(runs) == (mean, low, high)
    # Runs are drawn as well: two that never vary may both be the one or the other.
    assert interquartile_mean([np.zeros(8), np.full(8, 4.0)]) == (2, 0, 4)
    assert interquartile_mean([np.full(8, 4.0)]) == (4, 4, 4)
    assert interquartile_mean([np.array([21.0])]) == (21, None, None)


def test_a_profile_is_the_share_of_runs_above_each_threshold():
    """Every game counts alike, however many runs it has."""
    games = [np.array([0.0, 1.0]), np.array([0.5, 0.5, 2.0, 3.0])]
    profile = performance_profile(games, np.array([-1.0, 0.0, 0.5, 1.0, 2.5, 3.0]))
    np.testing.assert_allclose(profile.share, [1, 0.75, 0.5, 0.25, 0.125, 0])
    assert (profile.low <= profile.share).all() and (profile.share <= profile.high).all()
    assert profile.low[0] == profile.high[0] == 1 and profile.high[-1] == 0
    alike = performance_profile([np.full(5, 7.0)], np.array([6.0, 7.0]))
    np.testing.assert_array_equal([alike.low, alike.share, alike.high], [[1, 0]] * 3)
