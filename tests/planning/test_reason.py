"""The reason that is told is the one that decided."""

import numpy as np
import pytest

from semrl.core import Plan, Scenarios
from semrl.planning import reason


def a_plan(returns, progress, ends, *, rewards=None, path=7, **more):
    """A plan whose scenarios are in order already."""
    n = len(returns)
    rewards = np.array(rewards or [[int(value), 0] for value in returns])
    states = np.repeat(np.array(ends, np.float32)[:, None, None], 2, axis=1)  # (n, 2, 1)
    return Plan(
        node=0,
        path=np.arange(path),
        scenarios=Scenarios(actions=np.zeros((n, 2), np.int64), states=states, rewards=rewards, values=np.zeros(n)),
        returns=np.array(returns, np.float64),
        end_nodes=np.zeros(n, np.int64),
        progress=np.array(progress),
        **more,
    )


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        (a_plan([0], [0], [0]), "There is only one scenario."),
        (a_plan([1, 0, -1], [0, 3, 3], [0, 1, 2]), "because it is the only one with a predicted gain."),
        (a_plan([0, -1, -1], [0, 3, 3], [0, 1, 2]), "because it is the only one without a predicted loss."),
        (a_plan([2, 1, 0], [0, 3, 3], [0, 1, 2]), "because its predicted return, +2, is the highest."),
        (a_plan([-1, -2], [0, 3], [0, 1]), "because its predicted return, -1, is the highest."),
        (
            a_plan([1, 0], [0, 3], [0, 1], rewards=[[1, 0], [1, -1]]),
            "because it is the only one without a predicted loss.",
        ),
        (
            a_plan([0, 0, 0], [2, 1, -1], [0, 1, 2]),
            "All 3 scenarios predict the same return; scenario 1 wins because it ends furthest along the path "
            "(node 3 of 7).",
        ),
        (a_plan([1, 1, 0], [2, 1, 4], [0, 1, 2]), "2 scenarios share the highest return; scenario 1 wins"),
        (a_plan([0, 0, 0], [2, 2, -1], [0, 1, 2]), "closest to the centre of the furthest node reached (node 3 of 7)."),
        (a_plan([0, 0, 0], [-1, -1, -1], [0, 1, 2]), "closest to the end of the path, on which none of these ends."),
        (a_plan([0, 0], [-1, -1], [0, 1], path=0), "closest to the centre of a node (no way to a gain is known)."),
        (
            a_plan([0, 0], [-1, -1], [0, 1], path=0, seeks_novelty=True),
            "farthest from all that is known (no reward was met yet).",
        ),
        (a_plan([0, 0, 0], [2, 2, 2], [5, 5, 6]), ", the first of 2 that end in the same state."),
        (a_plan([0, 0], [2, 2], [5, 5]), "All 2 scenarios predict the same, so the first one is taken."),
    ],
)
def test_each_priority_has_its_words(plan, said):
    assert reason(plan).endswith(said) or reason(plan).startswith(said)
