"""What was learned of concepts as rules that a person can check: few literals, how often they held, and an otherwise.

Trees predict; these explain. For each event of a concept, such as "vy turns", conditions of at most two literals over a
fixed vocabulary are chosen one after the other, each for what those before it left (a decision list, Rivest 1987).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.world_model.lifted.features import ACTION, N_OWN, N_RELATION, TOUCHING_NEXT
from semrl.world_model.lifted.play import LATER_VX
from semrl.world_model.rules import Rule

REWARD = "the reward"
"""What rules about it are about."""

LEAST_SPEED_PX = 0.3
"""A decision: what is slower along an axis does not turn there."""

SAME_PX = 1.0
"""A decision: velocities that differ by less are the same, to people."""

_MOST_ROWS = 20_000  # the newest, that rules are read from
_FEWEST = 3  # times that a condition must have been right
_LEAST_WORTH, _LEAST_PRECISION = 0.15, 0.3
_TRIVIAL = 0.9  # share of the rows: what holds more often says nothing
_EDGE_PX, _FARTHEST = 1.0, 0.9995  # share of the places beyond an edge: some are mistakes
_OTHERWISE = ("otherwise",)
_PRECISION = 0.5  # what recall counts against precision

Mask = NDArray[np.bool_]


class About(NamedTuple):
    """A concept of which rules are read, and what it is related to."""

    name: str
    families: Sequence[str]
    controlled: bool


class _Event(NamedTuple):
    """What is to be explained, of the rows where it could have been."""

    about: str
    claim: str
    value: float
    possible: Mask
    happened: Mask
    most: int


def read_lists(rows: Floats, targets: Floats, about: About, n_actions: int) -> list[Rule]:
    """Read rules from what was seen of the things of one concept; an action is written ``#number``.

    Parameters
    ----------
    rows
        ``(n, f)``, see `semrl.world_model.lifted.features.describe`.
    targets
        ``(n, 10)``, see `semrl.world_model.lifted.play.TARGETS`.
    about
        The concept.
    n_actions
        Number of actions.
    """
    moving = np.abs(rows[:, :2]).max(axis=1) >= LEAST_SPEED_PX
    rows, targets = rows[moving][-_MOST_ROWS:], targets[moving][-_MOST_ROWS:]
    if len(rows) < 2 * _FEWEST:
        return []
    literals = _literals(rows, about)
    rules = _rewards(targets, about, literals)
    if about.controlled:
        return [*rules, *_effects(rows, targets, about, n_actions)]
    return [*rules, *(rule for event in _turns(rows, targets, about) for rule in _list(event, literals))]


def joined_lists(lists: Sequence[Sequence[Rule]]) -> list[Rule]:
    """Join the rules of several concepts; first, and of rewards alone, the one that explains them best."""

    def explained(rules: Sequence[Rule]) -> float:
        said = [rule for rule in rules if rule.about == REWARD and rule.conditions != _OTHERWISE]
        return sum((rule.right or 0) ** 2 / max(rule.decisions, 1) for rule in said)

    best = max(range(len(lists)), key=lambda i: explained(lists[i]), default=-1)
    rewards = [rule for rule in lists[best] if rule.about == REWARD] if best >= 0 else []
    ordered = sorted(range(len(lists)), key=lambda i: i != best)
    return rewards + [rule for i in ordered for rule in lists[i] if rule.about != REWARD]


def _literals(rows: Floats, about: About) -> dict[str, Mask]:
    """Return what may be said of each row."""
    said: dict[str, Mask] = {}
    for k, (name, outwards) in enumerate((("left", -1), ("top", -1), ("right", 1), ("bottom", 1))):
        farthest = outwards * np.quantile(outwards * rows[:, 6 + k], _FARTHEST)
        said[f"it is beyond its {name} edge next"] = outwards * (rows[:, 10 + k] - farthest) >= -_EDGE_PX
    for k, family in enumerate(about.families):
        begin = N_OWN + N_RELATION * k
        part = rows[:, begin : begin + N_RELATION]
        said[f"it touches {family} next"] = part[:, TOUCHING_NEXT] > 0.5
        there = part[:, 0] > 0.5
        said[f"no {family} is level with it"] = ~there | (part[:, 2] > 0)
    for name, axis in (("to the right", 0), ("down", 1)):
        said[f"it goes {name}"] = rows[:, axis] > 0
    return {name: mask for name, mask in said.items() if mask.mean() < _TRIVIAL}


def _rewards(targets: Floats, about: About, literals: dict[str, Mask]) -> list[Rule]:
    """Say what brings gains, what losses, and how often there was neither otherwise."""
    rules: list[Rule] = []
    left = np.ones(len(targets), np.bool_)
    for sign in (1, -1):
        happened = targets[:, 3] == sign
        if happened.sum() >= _FEWEST - 1:
            chosen, left = _chosen(_Event(REWARD, f"{sign:+d} by {about.name}", sign, left, happened, 1), literals)
            rules += chosen
    neither = _Event(REWARD, f"none by {about.name}", 0.0, left, targets[:, 3] == 0, 0)
    return [*rules, _rule(neither, _OTHERWISE, left)] if rules and left.any() else rules


def _turns(rows: Floats, targets: Floats, about: About) -> list[_Event]:
    """Return which turns are to be explained of a concept: how its velocities change sign."""
    events = []
    for axis, name in enumerate(("vx", "vy")):
        before, after = rows[:, axis], targets[:, LATER_VX + axis]
        possible = ~np.isnan(after) & (np.abs(before) >= LEAST_SPEED_PX)
        turned = possible & (np.sign(after) == -np.sign(before))
        mirrored = turned & (np.abs(after + before) <= SAME_PX)
        exact = 2 * mirrored.sum() > turned.sum()
        claim = f"{name} := −{name}" if exact else f"{name} turns"
        events.append(_Event(f"{about.name} {name}", claim, -1.0, possible, mirrored if exact else turned, 3))
    return [event for event in events if event.happened.sum() >= _FEWEST - 1]


def _list(event: _Event, literals: dict[str, Mask]) -> list[Rule]:
    """Choose conditions, and say what is left of the event otherwise."""
    rules, left = _chosen(event, literals)
    return [*rules, _rule(event, _OTHERWISE, left)] if rules and left.any() else rules


def _chosen(event: _Event, literals: dict[str, Mask]) -> tuple[list[Rule], Mask]:
    """Choose conditions one after the other, each for what those before it left; return what all of them leave."""
    rules: list[Rule] = []
    left = event.possible.copy()
    while len(rules) < event.most:
        worth, best, mask = max(
            ((_worth(left & mask, left & event.happened), said, mask) for said, mask in _conditions(literals)),
            key=lambda one: (one[0], -len(one[1])),
        )
        if worth < _LEAST_WORTH:
            break
        rules.append(_rule(event, best, left & mask))
        left &= ~mask
    return rules, left


def _conditions(literals: dict[str, Mask]) -> list[tuple[tuple[str, ...], Mask]]:
    """Return every literal, and every two of them."""
    names = list(literals)
    single: list[tuple[tuple[str, ...], Mask]] = [((name,), literals[name]) for name in names]
    pairs = [((one, other), literals[one] & literals[other]) for i, one in enumerate(names) for other in names[i + 1 :]]
    return single + pairs


def _worth(covered: Mask, wanted: Mask) -> float:
    """Return how well a condition predicts an event, 0 … 1: a mean of precision and recall that favours precision."""
    right, n = int((covered & wanted).sum()), int(covered.sum())
    if right < min(_FEWEST, int(wanted.sum())) or right < _LEAST_PRECISION * n or not right:
        return 0.0
    precision, recall = right / n, right / wanted.sum()
    weight = _PRECISION**2
    return float((1 + weight) * precision * recall / (weight * precision + recall))


def _rule(event: _Event, said: tuple[str, ...], covered: Mask) -> Rule:
    right = int((covered & event.happened).sum())
    return Rule(
        about=event.about, conditions=said, value=event.value, decisions=int(covered.sum()), error=0.0,
        claim=event.claim, right=right,
    )  # fmt: skip


def _effects(rows: Floats, targets: Floats, about: About, n_actions: int) -> list[Rule]:
    """Say to which velocity each action leads, soonest or one decision later, along the axis that it matters to."""
    done = rows[:, ACTION].astype(np.int64)
    shares = {column: _explained(targets[:, column], done, n_actions) for column in (0, 1, LATER_VX, LATER_VX + 1)}
    column = max(shares, key=lambda one: shares[one])
    axis = column % LATER_VX
    name, after, rules = ("vx", "vy")[axis], targets[:, column], []
    for action in range(n_actions):
        values = after[(done == action) & ~np.isnan(after)]
        if len(values) < _FEWEST:
            continue
        value = float(np.median(values))
        way = "up" if axis else "to the left"
        way = ("down" if axis else "to the right") if value > 0 else way
        right = int((np.sign(values) == np.sign(value)).sum()) if value else int((np.abs(values) <= SAME_PX).sum())
        rules.append(
            Rule(
                about=f"{about.name} {name}", conditions=(f"the action is #{action}",), value=value,
                decisions=len(values), error=float(values.std()), right=right,
                claim=f"{name} is {value:+.2g} px, {way}," if value else f"{name} is 0,",
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
