"""What decision lists explain of the things of a concept: rewards, turns, and what befalls things that are steered."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from semrl.core import Floats
from semrl.world_model.lifted.features import ACTION, OWN_NAMES
from semrl.world_model.lifted.play import LATER_VX
from semrl.world_model.lifted.samples import LATER_ACTION, LATER_REWARD, REWARD_COLUMN
from semrl.world_model.lifted.steering import AXES, LEAST_SPEED_PX, SAME_PX, WAYS, Steered, moves
from semrl.world_model.lifted.vocabulary import Mask

REWARD = "the reward"
"""What rules about it are about."""

FEWEST = 3
"""Times that a condition must have been right."""

_AGE = OWN_NAMES.index("age")
_SETTLED = 2  # decisions: only then the velocity of what came in at an edge is known
_USUAL = 0.95  # share of the speeds: what is twice as fast has taken the track of something else

LATE = 0.5
"""What comes one decision later than at once counts so much: it is right to say that it comes, and not to say so."""

Came = Callable[[Floats, Floats], Floats]
"""What came of ``(n, f)`` rows, given their ``(n, 12)`` targets, as numbers, ``(n,)``: 0 where nothing did, `LATE`
times its number where it came late, no number where nothing could come or that is not known."""


class Event(NamedTuple):
    """What is to be explained."""

    about: str
    claim: str
    value: float
    """What rules note of it."""
    came: Came
    code: float
    """What came where the claim did."""
    most: int
    """Conditions for it."""


def came_as_reward(rows: Floats, targets: Floats) -> Floats:
    """Return the signs of the rewards where things move, a `Came`."""
    now, later = targets[:, REWARD_COLUMN], np.nan_to_num(targets[:, LATER_REWARD])
    return _where(moves(rows), np.where(now == 0, LATE * later, now))


def came_as_steered(steered: Steered) -> Came:
    """Return whether things that move go on as they are steered."""

    def came(rows: Floats, targets: Floats) -> Floats:
        obeys, known = steered.obeys(rows, targets)
        return _where(moves(rows) & known, obeys)

    return came


def rewards_by(name: str, came: Floats) -> list[Event]:
    """Return which rewards are to be explained by a concept, given those that came, ``(n,)``."""
    return [
        Event(REWARD, f"{sign:+d} by {name}", sign, came_as_reward, sign, 1)
        for sign in (1, -1)
        if (came == sign).sum() >= FEWEST - 1
    ]


def turns_of(name: str, rows: Floats, targets: Floats) -> list[Event]:
    """Return which turns are to be explained: how velocities change sign within two decisions."""
    usual = np.quantile(np.abs(rows[:, :2]), _USUAL, axis=0)
    fastest: Floats = (2 * usual + SAME_PX).astype(np.float32)
    events = []
    for axis, velocity in enumerate(AXES):
        turned, mirrored = (_turns(axis, fastest, mirrored=only) for only in (False, True))
        exact = 2 * (mirrored(rows, targets) > 0).sum() > (turned(rows, targets) > 0).sum()
        claim = f"{velocity} := −{velocity}" if exact else f"{velocity} turns"
        events.append(Event(f"{name} {velocity}", claim, -1.0, mirrored if exact else turned, 1, 3))
    return [event for event in events if (event.came(rows, targets) == event.code).sum() >= FEWEST - 1]


def upsets_of(name: str, steered: Steered, rows: Floats, targets: Floats) -> list[Event]:
    """Return what is to be explained where things do not go as they are steered: they stop, or go another way."""
    axis = steered.axis
    velocity = AXES[axis]
    events = [Event(f"{name} {velocity}", f"{velocity} is 0 whatever the action,", 0.0, _stops(steered), 1, 2)]
    for way, word in zip((-1, 1), WAYS[axis], strict=True):
        claim = f"it goes {word} whatever the action,"
        events.append(Event(f"{name} {velocity}", claim, way, _goes_astray(steered, way), 1, 2))
    return [event for event in events if (event.came(rows, targets) == event.code).sum() >= FEWEST - 1]


def _turns(axis: int, fastest_px: Floats, *, mirrored: bool) -> Came:
    """Return whether things turn; what is faster than they are has taken the track of one that left."""

    def came(rows: Floats, targets: Floats) -> Floats:
        """Tell of each decision whether the thing turned, soon or late."""
        before, soon, after = rows[:, axis], targets[:, axis], targets[:, LATER_VX + axis]
        steps = np.concatenate([rows[:, :2], targets[:, [0, 1, LATER_VX, LATER_VX + 1]]], axis=1)
        is_it = (np.abs(steps) <= np.tile(fastest_px, 3)).all(axis=1)
        possible = is_it & (np.abs(before) >= LEAST_SPEED_PX) & (rows[:, _AGE] >= _SETTLED)
        turned = np.sign(after) == -np.sign(before)
        if mirrored:
            turned &= _mirrored(rows, targets, axis)
        return _where(possible, np.where(np.abs(soon - before) <= SAME_PX, LATE, 1) * turned)

    return came


def _mirrored(rows: Floats, targets: Floats, axis: int) -> Mask:
    """Tell whether what turned has the speed that it had: a decision amid which it turned shows less."""
    before, last, soon, after = rows[:, axis], rows[:, 2 + axis], targets[:, axis], targets[:, LATER_VX + axis]
    amid_present = np.abs(after + last) <= SAME_PX
    amid_later = (np.abs(soon - before) <= SAME_PX) & (np.abs(after) <= np.abs(before))
    mirrored: Mask = (np.abs(after + before) <= SAME_PX) | amid_present | amid_later
    return mirrored


def _stops(steered: Steered) -> Came:
    """Return whether what moves as it is steered, in two decisions, comes to rest."""

    def came(rows: Floats, targets: Floats) -> Floats:
        way = np.sign(rows[:, steered.axis]) * (np.abs(rows[:, steered.axis]) >= LEAST_SPEED_PX)
        now, later = (np.sign(steered.wanted(actions)) for actions in (rows[:, ACTION], targets[:, LATER_ACTION]))
        return _steered(
            steered, targets, (way != 0) & (now == way) & (later == way), lambda v: np.abs(v) < LEAST_SPEED_PX
        )

    return came


def _goes_astray(steered: Steered, way: int) -> Came:
    """Return whether what neither goes one way nor is steered there, in two decisions, goes there."""

    def came(rows: Floats, targets: Floats) -> Floats:
        now, later = (way * steered.wanted(actions) for actions in (rows[:, ACTION], targets[:, LATER_ACTION]))
        elsewhere = way * rows[:, steered.axis] < LEAST_SPEED_PX
        possible = elsewhere & (now < LEAST_SPEED_PX) & (later < LEAST_SPEED_PX)
        return _steered(steered, targets, possible, lambda velocities: way * velocities >= LEAST_SPEED_PX)

    return came


def _steered(steered: Steered, targets: Floats, possible: Mask, happens: Callable[[Floats], Mask]) -> Floats:
    """Return whether something happens to the velocities that two decisions lead to, late if to the second alone."""
    soon, later = targets[:, steered.column], targets[:, LATER_VX + steered.axis]
    return _where(possible & ~np.isnan(later), np.where(happens(soon), 1, np.where(happens(later), LATE, 0)))


def _where(possible: Mask, happened: Mask | Floats) -> Floats:
    came: Floats = np.where(possible, happened, np.nan).astype(np.float32)
    return came


def agree(one: Floats, other: Floats) -> Mask:
    """Tell where two say the same of what comes, ``(n,)`` each; what comes late may be said to come or not."""
    late = (np.abs(one) == LATE) | (np.abs(other) == LATE)
    same: Mask = (np.sign(one) == np.sign(other)) | (late & (one * other == 0))
    return same
