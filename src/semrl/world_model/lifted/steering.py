"""What actions do to the things of a concept, for people: to which velocity each of them leads."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.world_model.lifted.features import ACTION
from semrl.world_model.lifted.play import LATER_VX
from semrl.world_model.lifted.vocabulary import Mask
from semrl.world_model.rules import Rule

LEAST_SPEED_PX = 0.3
"""A decision: what is slower along an axis rests there."""

SAME_PX = 1.0
"""A decision: velocities that differ by less are the same, to people."""

AXES = ("vx", "vy")
"""What velocities are called."""

WAYS = (("to the left", "to the right"), ("up", "down"))
"""Backwards and forwards along each axis."""

LEAST_TOLD = 0.2
"""Share of the decisions by which actions must say more often where things go than their commonest way does."""

_FEWEST = 3  # times that an action must have been taken


def moves(rows: Floats) -> Mask:
    """Tell of which of ``(n, f)`` rows the things move."""
    moving: Mask = np.abs(rows[:, :2]).max(axis=1) >= LEAST_SPEED_PX
    return moving


class Steered(NamedTuple):
    """What actions do, along the axis that they matter to."""

    column: int
    """Of the targets: the velocity that they lead to, soonest or one decision later."""
    velocities_px: Floats
    """``(a,)`` float32, to which each leads; not a number for those that were hardly seen."""

    @property
    def axis(self) -> int:
        """Along which they steer."""
        return self.column % LATER_VX

    def wanted(self, actions: Floats) -> Floats:
        """Return the velocity that each of ``(n,)`` actions leads to; not a number where that is not known."""
        known = (actions >= 0) & (actions < len(self.velocities_px))
        numbers = np.where(known, actions, 0).astype(np.int64)
        wanted: Floats = np.where(known, self.velocities_px[numbers], np.nan).astype(np.float32)
        return wanted

    def obeys(self, rows: Floats, targets: Floats) -> tuple[Mask, Mask]:
        """Tell of ``(n, f)`` rows, given their targets, whether things do as steered, and whether that is known."""
        wanted, after = self.wanted(rows[:, ACTION]), targets[:, self.column]
        same: Mask = np.where(wanted == 0, np.abs(after) <= SAME_PX, np.sign(after) == np.sign(wanted))
        return same, ~np.isnan(wanted) & ~np.isnan(after)

    def steers(self, rows: Floats, targets: Floats) -> bool:
        """Tell whether actions, each counted alike, say much more often where things go than the commonest way does."""
        obeys, known = self.obeys(rows, targets)
        known &= moves(rows)
        after = targets[:, self.column]
        right = np.column_stack([obeys, np.abs(after) <= SAME_PX, after > 0, after < 0])[known]
        done = rows[known, ACTION]
        shares = [right[done == action].mean(axis=0) for action in np.unique(done)]
        told, *ways = np.mean(shares, axis=0) if shares else np.zeros(4)
        return bool(told - max(ways) >= LEAST_TOLD)


def steered_by(rows: Floats, targets: Floats, n_actions: int) -> Steered:
    """Find out what actions do to things that move, from ``(n, f)`` rows and their ``(n, 10)`` targets."""
    moving = moves(rows)
    done, targets = rows[moving, ACTION].astype(np.int64), targets[moving]
    shares = {column: _explained(targets[:, column], done, n_actions) for column in (0, 1, LATER_VX, LATER_VX + 1)}
    column = max(shares, key=lambda one: shares[one])
    after = targets[:, column]
    velocities = np.full(n_actions, np.nan, np.float32)
    for action in range(n_actions):
        values = after[(done == action) & ~np.isnan(after)]
        if len(values) >= _FEWEST:
            velocities[action] = np.median(values)
    return Steered(column, velocities)


def effects_of(name: str, steered: Steered, rows: Floats, targets: Floats) -> list[Rule]:
    """Say to which velocity each action leads, and how often it went that way; an action is written ``#number``."""
    axis, rules = steered.axis, []
    obeys, known = steered.obeys(rows, targets)
    known &= moves(rows)
    for action in np.flatnonzero(~np.isnan(steered.velocities_px)).tolist():
        value, taken = float(steered.velocities_px[action]), known & (rows[:, ACTION] == action)
        way = WAYS[axis][value > 0]
        rules.append(
            Rule(
                about=f"{name} {AXES[axis]}", conditions=(f"the action is #{action}",), value=value,
                decisions=int(taken.sum()), error=float(targets[taken, steered.column].std()),
                right=int((taken & obeys).sum()),
                claim=f"{AXES[axis]} is {value:+.2g} px, {way}," if value else f"{AXES[axis]} is 0,",
            )
        )  # fmt: skip
    return rules


def _explained(velocities: Floats, actions: NDArray[np.int64], n_actions: int) -> float:
    """Return which share of the variance of velocities the actions explain."""
    known = ~np.isnan(velocities)
    values, actions = velocities[known].astype(np.float64), actions[known]
    if not len(values) or not values.var():
        return 0.0
    within = sum(len(part) * part.var() for k in range(n_actions) if len(part := values[actions == k]))
    return float(1 - within / (len(values) * values.var()))
