"""An environment that begins anew by itself shows what one shows that is reset."""

import gymnasium as gym
import numpy as np
import pytest

from semrl import SemanticObservation, make_env

CATCH = "semrl/Catch-v0"


@pytest.mark.parametrize("run", ["semantic_run", "tracked_run", "objects_run"])
def test_an_episode_that_begins_by_itself_is_one_that_was_reset(run, request):
    run = request.getfixturevalue(run)
    by_itself = SemanticObservation(gym.wrappers.Autoreset(make_env(CATCH)), run)
    by_hand = SemanticObservation(make_env(CATCH), run)
    for env in (by_itself, by_hand):
        env.reset(seed=5)
    rng, over, begun = np.random.default_rng(0), False, 0
    for _ in range(150):
        action = int(rng.integers(2))
        seen, *told = by_itself.step(action)[:4]
        if over:
            expected, told_by_hand = by_hand.reset()[0], [0.0, False, False]
            begun += 1
            np.testing.assert_array_equal(seen[len(seen) // 2 :], 0.0)  # nothing has changed yet
        else:
            expected, *told_by_hand = by_hand.step(action)[:4]
        np.testing.assert_array_equal(seen, expected)
        assert told == told_by_hand
        over = told[1] or told[2]
    assert begun > 1
