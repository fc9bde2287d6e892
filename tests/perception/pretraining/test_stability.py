"""Stability (§3.2.3): the objects of a frame, shown again 250 batches later."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import balanced_accuracy_score

from semrl.core.arrays import digest
from semrl.perception.pretraining.stability import (
    StabilityConfig,
    StabilityTest,
    label_agreement,
    mean_absolute_difference,
)


class Drifting:
    """An estimator whose output grows by one with every batch."""

    def __init__(self):
        self.batches = 0

    def output(self, X):
        return X + self.batches


def stability_test(estimator, batches=250, limit=0.05):
    return StabilityTest(estimator.output, mean_absolute_difference, lambda value: value < limit, batches)


def batch(n):
    return np.full((1 + n % 3, 2), float(n))


def test_the_thesis_values():
    config = StabilityConfig()
    assert (config.batches, config.max_difference, config.min_agreement) == (250, 0.05, 0.95)


def test_the_first_value_comes_at_batch_251():
    estimator = Drifting()
    test = stability_test(estimator)
    for n in range(1, 251):
        estimator.batches = n
        assert not test.update(batch(n))
        assert test.values_ == []
    estimator.batches = 251
    test.update(batch(251))
    assert test.values_ == [250.0]  # batch 1 with what was learned after it: 250 further batches


def test_each_value_compares_with_250_batches_ago():
    estimator, shown = Drifting(), []
    outputs = {}

    def measure(before, after):
        shown.append((before, after))
        return 1.0

    test = StabilityTest(estimator.output, measure, lambda value: False, 250)
    for n in range(1, 521):
        estimator.batches = n * n
        outputs[n] = estimator.output(batch(n))
        test.update(batch(n))
        if n > 250:
            before, after = shown[-1]
            np.testing.assert_array_equal(before, outputs[n - 250])
            np.testing.assert_array_equal(after, estimator.output(batch(n - 250)))
    assert len(shown) == len(test.values_) == 270


def test_stable_is_what_the_last_value_says():
    estimator = Drifting()
    test = stability_test(estimator, batches=10)
    told = []
    for n in range(40):
        estimator.batches = min(n, 15) if n < 30 else n
        told.append(test.update(batch(n)))
    # Nothing changes from batch 15 to batch 29: outputs are equal from 25 on.
    assert [n for n in range(40) if told[n]] == list(range(25, 30))


def test_restored_it_goes_on_the_same():
    one, two = Drifting(), Drifting()
    straight, restored = stability_test(one, batches=20), stability_test(two, batches=20)
    restored.update(batch(99))
    for n in range(60):
        one.batches = two.batches = n
        if n in (0, 7, 33):  # empty, half full, full
            restored.from_arrays(straight.to_arrays())
            assert digest(restored.to_arrays()) == digest(straight.to_arrays())
        assert straight.update(batch(n)) == restored.update(batch(n))
    assert straight.values_ == restored.values_ and len(straight.values_) == 40


def test_mean_absolute_difference():
    assert mean_absolute_difference(np.array([[1.0, 2.0]]), np.array([[2.0, -1.0]])) == 2.0


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 7)), min_size=1, max_size=40))
@pytest.mark.filterwarnings("ignore:y_pred contains classes not in y_true", "ignore:A single label was found")
def test_agreement_is_scikit_learns_balanced_accuracy(pairs):
    before, after = np.array(pairs).T
    assert label_agreement(before, after) == pytest.approx(balanced_accuracy_score(before, after))


def test_rare_labels_count_as_much_as_common_ones():
    before = np.array([0] * 99 + [1])
    after = np.zeros(100, int)
    assert label_agreement(before, after) == 0.5
