"""What happens in an episode: contacts, bounces, things that appear and vanish, rewards, lost lives; compiled.

An event happens between two decisions and is reported at the second of them.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import ConceptTable, Floats, Ints, Scene
from semrl.core.kernels import compiled
from semrl.knowledge.relations import swept, touching

KINDS = ("contact", "bounce", "appears", "vanishes", "gain", "loss", "life lost")
"""What may happen; gain and loss are rewards."""

BORDERS = ("left border", "top border", "right border", "bottom border")

LEAST_SPEED_PX = 0.3
"""Along an axis, a decision, before and after: what is slower does not bounce."""

BORDER_PX = 1.0
"""What comes this close to a border, or would, bounces off it."""

_CONTACT, _BOUNCE, _APPEARS, _VANISHES = range(4)
_NOTHING, _BORDER = -1, -2  # in place of a second thing; −2 − k for border k


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """One thing that happened."""

    decision: int
    """After so many decisions of the episode."""
    kind: str
    """One of `KINDS`."""
    things: tuple[int, ...] = ()
    """Identities of who took part, who bounced first."""
    concepts: tuple[str, ...] = ()
    """Their concepts' names, and the border where that took part."""
    axis: str = ""
    """Of a bounce: ``x`` or ``y``, along which the velocity turned."""
    amount: float = 0.0
    """Of a gain or a loss: the reward; of a lost life: how many."""

    @property
    def sentence(self) -> str:
        """The event in words."""
        who = " and ".join(self.concepts) if self.kind == "contact" else (*self.concepts, "")[0]
        where = f" off {self.concepts[1]}" if self.kind == "bounce" and len(self.concepts) > 1 else ""
        sentences = {
            "contact": f"{who} touch",
            "bounce": f"{who} bounces{where}, its v{self.axis} turns",
            "gain": f"reward {self.amount:+g}",
            "loss": f"reward {self.amount:+g}",
        }
        return sentences.get(self.kind, f"{who} {self.kind}" if who else self.kind)


def events_of(
    scenes: Sequence[Scene], table: ConceptTable, rewards: Sequence[float] = (), lives: Sequence[int] = ()
) -> list[Event]:
    """Return what happened in an episode, in the order of time.

    Parameters
    ----------
    scenes
        One for each observation, from the first one on.
    table
        What the things are.
    rewards
        What led to each of them but the first; empty where that is not known.
    lives
        Left at each; empty where there are none.
    """
    found = [
        _event(row, scenes, table)
        for before, after in itertools.pairwise(range(len(scenes)))
        for row in _between(scenes[before], scenes[after], table, after)
    ]
    for decision, reward in enumerate(rewards, 1):
        if reward:
            found.append(Event(decision=decision, kind="gain" if reward > 0 else "loss", amount=float(reward)))
    for decision, (before, after) in enumerate(itertools.pairwise(lives), 1):
        if after < before:
            found.append(Event(decision=decision, kind="life lost", amount=before - after))
    return sorted(found, key=lambda event: event.decision)


def _between(before: Scene, after: Scene, table: ConceptTable, decision: int) -> list[tuple[int, ...]]:
    """Return rows: decision, kind, places of both things (before or after), axis."""
    rows = changes(
        (before.ids, before.boxes_px, before.velocities_px),
        (after.ids, after.boxes_px),
        table.static[before.concepts],
        table.arena_px,
    )
    steered = table.controlled[before.concepts]  # what is steered turns without bouncing
    return [(decision, *row) for row in rows.tolist() if row[0] != _BOUNCE or not steered[row[1]]]


def _event(row: tuple[int, ...], scenes: Sequence[Scene], table: ConceptTable) -> Event:
    decision, kind, one, other, axis = row
    scene = scenes[decision] if kind == _APPEARS else scenes[decision - 1]
    things = (one, other) if other >= 0 else (one,)
    concepts = tuple(table.names[scene.concepts[i]] for i in things)
    if other <= _BORDER:
        concepts = (*concepts, BORDERS[_BORDER - other])
    return Event(
        decision=decision,
        kind=KINDS[kind],
        things=tuple(int(scene.ids[i]) for i in things),
        concepts=concepts,
        axis="xy"[axis] if axis >= 0 else "",
    )


Before = tuple[Ints, Floats, Floats]
After = tuple[Ints, Floats]


@compiled
def changes(before: Before, after: After, still: NDArray[np.bool_], arena: Floats) -> Ints:
    """Return what happened between two scenes, ``(m, 4)``: kind, first and second thing, axis.

    Parameters
    ----------
    before
        Identities, boxes and velocities.
    after
        Identities and boxes.
    still
        Which of the first stay where they are: two of them are never in contact.
    arena
        Left, top, right, bottom.
    """
    (ids, boxes, velocities), (new_ids, new_boxes) = before, after
    found, n = np.empty((len(ids) ** 2 + 3 * len(ids) + len(new_ids), 4), np.int64), 0
    match = np.full(len(ids), -1, np.int64)
    known = np.zeros(len(new_ids), np.bool_)
    for i in range(len(ids)):
        for j in range(len(new_ids)):
            if ids[i] == new_ids[j]:
                match[i], known[j] = j, True
    for i in range(len(ids)):
        if match[i] < 0:
            found[n] = _VANISHES, i, _NOTHING, -1
            n += 1
            continue
        for j in range(i):
            if match[j] >= 0 and not (still[i] and still[j]) and _meet(boxes, new_boxes, match, j, i):
                found[n] = _CONTACT, j, i, -1
                n += 1
        for axis in range(2):
            speed, now = velocities[i, axis], new_boxes[match[i], axis] - boxes[i, axis]
            if speed * now < 0 and min(abs(speed), abs(now)) >= LEAST_SPEED_PX:
                found[n] = _BOUNCE, i, _cause(boxes, velocities, match, (new_boxes, arena), i, axis), axis
                n += 1
    for k in np.flatnonzero(~known):
        found[n] = _APPEARS, k, _NOTHING, -1
        n += 1
    return found[:n]


@compiled
def _meet(boxes: Floats, new_boxes: Floats, match: Ints, i: int, j: int) -> bool:
    """Whether two things that did not touch do so now, or did on the way."""
    if touching(boxes[i], boxes[j]):
        return False
    one, other = new_boxes[match[i]], new_boxes[match[j]]
    if touching(one, other):
        return True
    return swept(boxes[i], one[:2] - boxes[i, :2], boxes[j], other[:2] - boxes[j, :2]) <= 1


@compiled
def _cause(  # noqa: PLR0917
    boxes: Floats, velocities: Floats, match: Ints, around: tuple[Floats, Floats], i: int, axis: int
) -> int:
    """Return what a thing bounced off: the first one that it would have touched; a border; or nothing that is known."""
    new_boxes, arena = around
    best, cause = 1.0, _NOTHING
    for j in range(len(boxes)):
        if j == i or match[j] < 0:
            continue
        soon = swept(boxes[i], velocities[i], boxes[j], velocities[j])
        if touching(new_boxes[match[i]], new_boxes[match[j]]):
            soon = min(soon, 1.0)
        if soon < best or (soon <= best and cause == _NOTHING):
            best, cause = soon, int(j)
    if cause != _NOTHING:
        return cause
    if velocities[i, axis] < 0 and boxes[i, axis] + velocities[i, axis] <= arena[axis] + BORDER_PX:
        return _BORDER - axis
    if velocities[i, axis] > 0 and boxes[i, axis + 2] + velocities[i, axis] >= arena[axis + 2] - BORDER_PX:
        return _BORDER - axis - 2
    return _NOTHING
