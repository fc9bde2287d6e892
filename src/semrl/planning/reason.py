"""Why the best scenario is the best, in a sentence: the order of `rank` (§3.4.4), read backwards."""

from semrl.core import Plan
from semrl.planning.ranking import OFF_PATH


def reason(plan: Plan) -> str:
    """Say in one sentence which of the priorities put the first scenario of a plan first (§3.4.4).

    Parameters
    ----------
    plan
        As `rank` returns it, its scenarios the best first, on a map that is not empty.
    """
    n = len(plan.scenarios)
    if n == 1:
        return "There is only one scenario."
    tied = int((plan.returns == plan.returns[0]).sum())
    if tied == 1:
        return f"Scenario 1 wins because {_by_return(plan)}."
    level = int((plan.progress[:tied] == plan.progress[0]).sum())
    # The last two states are all that closeness to a node can depend on.
    ends = plan.scenarios.states[:level, -2:]
    same = int((ends == ends[0]).all(axis=(1, 2)).sum())
    if same == n:
        return f"All {n:,} scenarios predict the same, so the first one is taken."
    tie = (
        f"All {n:,} scenarios predict the same return" if tied == n else f"{tied:,} scenarios share the highest return"
    )
    why = _by_progress(plan) if level == 1 else _by_closeness(plan)
    first = f", the first of {same:,} that end in the same state" if same > 1 else ""
    return f"{tie}; scenario 1 wins because it {why}{first}."


def _by_return(plan: Plan) -> str:
    gains, losses = plan.scenarios.rewards.max(axis=1) > 0, plan.scenarios.rewards.min(axis=1) < 0
    if gains[0] and not gains[1:].any():
        return "it is the only one with a predicted gain"
    if not losses[0] and losses[1:].all():
        return "it is the only one without a predicted loss"
    return f"its predicted return, {plan.returns[0]:+.3g}, is the highest"


def _by_progress(plan: Plan) -> str:
    return f"ends furthest along the path (node {plan.progress[0] + 1} of {len(plan.path)})"


def _by_closeness(plan: Plan) -> str:
    if plan.seeks_novelty:
        return "ends farthest from all that is known (no reward was met yet)"
    if not len(plan.path):
        return "ends closest to the centre of a node (no way to a gain is known)"
    if plan.progress[0] == OFF_PATH:
        return "ends closest to the end of the path, on which none of these ends"
    return f"ends closest to the centre of the furthest node reached (node {plan.progress[0] + 1} of {len(plan.path)})"
