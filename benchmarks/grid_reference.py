"""MiniGrid's rules as operators, written by hand, and learned operators in the same words.

A literal of a precondition is a cell, counted from the agent, and what it holds, or a thing and whether one lies
anywhere. What is carried is not to be seen: with one key in a layout it is carried where none lies anywhere.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grid_oracle import AHEAD

from semrl.planning.symbolic.operators import Effect, Operator

Literals = frozenset[tuple[Any, Any]]

ACTIONS = ("left", "right", "forward", "pickup", "drop", "toggle", "done")
"""In MiniGrid's order."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Schema:
    """An operator: where all its literals hold, so do its effects afterwards."""

    action: str
    facing: int
    when: Literals
    effects: Literals


def reference(things: set[str]) -> list[Schema]:
    """Return MiniGrid's operators about the things that there are, for each direction."""
    return [schema for facing in range(4) for schema in _facing(facing, things)]


def _facing(facing: int, things: set[str]) -> list[Schema]:
    front = AHEAD[facing]
    moved, won = ("move", front), {("gain", 1), ("ended", True)}
    carries, free = ("key", False), ("key", True)
    told: list[tuple[str, str, set[Any], set[Any]]] = [
        ("left", "", set(), {("facing", (facing - 1) % 4)}),
        ("right", "", set(), {("facing", (facing + 1) % 4)}),
        ("forward", "empty", {(front, "empty")}, {moved}),
        ("forward", "open door", {(front, "open door")}, {moved}),
        ("forward", "goal", {(front, "goal")}, {moved, *won}),
        ("pickup", "key", {(front, "key")}, {(front, "empty")}),
        ("pickup", "ball", {(front, "ball"), free}, {(front, "empty"), *won}),
        ("drop", "key", {(front, "empty"), carries}, {(front, "key")}),
        ("toggle", "closed door", {(front, "closed door")}, {(front, "open door")}),
        ("toggle", "open door", {(front, "open door")}, {(front, "closed door")}),
        ("toggle", "locked door", {(front, "locked door"), carries}, {(front, "open door")}),
    ]
    return [
        Schema(action=action, facing=facing, when=frozenset(when), effects=frozenset(effects))
        for action, about, when, effects in told
        if not about or about in things
    ]


def in_words(operators: Iterable[Operator], things: Mapping[int, str], ways: Mapping[int, int]) -> list[Schema]:
    """Return the learned operators that change something, in the words of the reference.

    Two that differ in whether a thing lies anywhere, and do the same, are one that does not ask; what lies in a cell
    that is asked about lies somewhere, which is not said again.

    Parameters
    ----------
    operators
        As they were learned.
    things
        Concept of a cell → what it is.
    ways
        Kind of the thing that the actions move → the direction that it faces.
    """
    found: dict[Schema, None] = {}
    for one in operators:
        effects = _effects(one.kind, one.effect, things, ways)
        if effects and one.kind in ways:
            cells = {(ask, things.get(value, "?")) for ask, value in one.when if isinstance(ask, tuple)}
            anywhere = {(things.get(ask, "?"), bool(value)) for ask, value in one.when if isinstance(ask, int)}
            when = frozenset(cells | anywhere - {(thing, True) for _, thing in cells})
            found[Schema(action=ACTIONS[one.action], facing=ways[one.kind], when=when, effects=effects)] = None
    return _merged(list(found))


def _effects(kind: int, effect: Effect, things: Mapping[int, str], ways: Mapping[int, int]) -> Literals:
    told: set[tuple[Any, Any]] = {(offset, things.get(concept, "?")) for offset, concept in effect.changes}
    if effect.move != (0, 0):
        told.add(("move", effect.move))
    if effect.kind != kind:
        told.add(("facing", ways.get(effect.kind, -1)))
    if effect.gain:
        told.add(("gain", effect.gain))
    if effect.ends:
        told.add(("ended", True))
    return frozenset(told)


def _merged(schemas: list[Schema]) -> list[Schema]:
    for one in schemas:
        for name, value in one.when:
            if not isinstance(value, bool):
                continue
            rest = one.when - {(name, value)}
            other = Schema(action=one.action, facing=one.facing, when=rest | {(name, not value)}, effects=one.effects)
            if other in schemas:
                left = [each for each in schemas if each not in (one, other)]
                return _merged([*left, Schema(action=one.action, facing=one.facing, when=rest, effects=one.effects)])
    return schemas


def compared(learned: Sequence[Schema], told: Sequence[Schema]) -> dict[str, dict[str, Counter[str]]]:
    """Count literals that are in both, only learned (extra) or only told (missing).

    Each learned operator is laid beside the one of the reference, of the same action and direction, with which it
    shares most; of two beside the same one the second counts as extra.

    Returns
    -------
    dict
        Action → ``when`` and ``effects`` → right, extra, missing.
    """
    counts = {one.action: {"when": Counter[str](), "effects": Counter[str]()} for one in told}
    pairs = [
        (len(own.when & one.when) + len(own.effects & one.effects) - len(own.when ^ one.when) / 100, i, j)
        for i, own in enumerate(learned)
        for j, one in enumerate(told)
        if own.action == one.action and own.facing == one.facing
    ]
    beside: dict[int, int] = {}
    for shared, i, j in sorted(pairs, reverse=True):
        if shared > 0 and i not in beside and j not in beside.values():
            beside[i] = j
    for i, own in enumerate(learned):
        one = told[beside[i]] if i in beside else None
        count = counts.setdefault(own.action, {"when": Counter[str](), "effects": Counter[str]()})
        for part, of_own, of_one in _parts(own, one):
            count[part].update(right=len(of_own & of_one), extra=len(of_own - of_one), missing=len(of_one - of_own))
    for j, one in enumerate(told):
        if j not in beside.values():
            counts[one.action]["when"].update(missing=len(one.when))
            counts[one.action]["effects"].update(missing=len(one.effects))
    return counts


def _parts(own: Schema, one: Schema | None) -> list[tuple[str, Literals, Literals]]:
    none: Literals = frozenset()
    return [
        ("when", own.when, one.when if one else none),
        ("effects", own.effects, one.effects if one else none),
    ]
