"""Planners that rank anew, by a judge, what another planner has imagined."""

from typing import Generic, TypeVar

from semrl.planning.protocol import Planner

Judge = TypeVar("Judge")


class JudgedPlanner(Generic[Judge]):
    """What these planners have in common.

    Their plans are not kept while what was predicted comes: what is left of one would be measured by rewards alone.

    Parameters
    ----------
    planner
        Imagines scenarios, and ranks them by reward.
    judge
        Judges what is imagined.
    """

    def __init__(self, planner: Planner, judge: Judge) -> None:
        self.planner = planner
        self.judge = judge

    @property
    def depth(self) -> int:
        """How many actions a plan has."""
        return self.planner.depth
