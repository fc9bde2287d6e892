"""What an ensemble makes of scenarios is what numpy makes of all members' answers."""

import numpy as np
import pytest

from semrl.world_model.ensemble import FEWEST_SCREENED, imagine_all

MEMBERS, LENGTH, DISCOUNT = 5, 6, 0.9


def answers(count, seed):
    """Return what members say of scenarios: losses and gains, and values of which many are alike."""
    rng = np.random.default_rng(seed)
    rewards = rng.choice([-1, 0, 0, 0, 1], (MEMBERS, count, LENGTH)).astype(np.float32)
    values = rng.choice([0.0, 0.25, 0.5], (MEMBERS, count)).astype(np.float32)
    return rewards, values, rng.random((count, LENGTH, 2), np.float32)


@pytest.mark.parametrize("screening", [0, 1, 2, MEMBERS])
@pytest.mark.parametrize("count", [1, FEWEST_SCREENED - 1, FEWEST_SCREENED, 33])
def test_means_and_deviations_are_those_of_all_members_about_the_scenarios_that_some_think_best(count, screening):
    rewards, values, predicted = answers(count, count)
    returns = (rewards * DISCOUNT ** np.arange(LENGTH)).sum(axis=2) + DISCOUNT**LENGTH * values
    best = np.arange(count)
    if 0 < screening < MEMBERS and count >= FEWEST_SCREENED:
        # numpy's stable order: of equal ones the first is taken
        best = np.sort(np.argsort(-returns[:screening].mean(axis=0), kind="stable")[: count // 4])

    def roll(tried, members):
        places = tried[:, 0]
        return predicted[places], rewards[members][:, places], values[members][:, places]

    sequences = np.repeat(np.arange(count)[:, None], LENGTH, axis=1)
    told = imagine_all(roll, sequences, members=MEMBERS, screening=screening, discount=DISCOUNT)
    np.testing.assert_array_equal(told.sequences, sequences[best])
    np.testing.assert_array_equal(told.predicted, predicted[best])
    np.testing.assert_allclose(told.rewards, rewards.mean(axis=0)[best], rtol=1e-6)
    np.testing.assert_allclose(told.values, values.mean(axis=0)[best], rtol=1e-6)
    np.testing.assert_allclose(told.uncertainties, returns.std(axis=0)[best], rtol=1e-5, atol=1e-6)
    assert {told.rewards.dtype, told.values.dtype, told.uncertainties.dtype} == {np.dtype(np.float32)}
