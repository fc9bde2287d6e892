"""MiniGrid's own state as an oracle: what every action truly does in states of its layouts, and how these look.

The learner never sees any of it. States are reached from the beginning of a layout by actions, and drawn so that each
situation (what is in front, what is carried, how doors are) counts alike.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semrl.core import Image
from semrl.envs import Game

DONE = 6
"""The action that does nothing."""
DOORS = ("open door", "closed door", "locked door")
"""In the order of MiniGrid's encoding."""
AHEAD = ((0, 1), (1, 0), (0, -1), (-1, 0))
"""Rows and columns to the cell in front, of each direction."""

Facts = dict[Any, Any]
"""Variable → value: ``at``, ``facing``, ``carried``, ``gain``, ``ended``, and each cell ``(row, column)``."""

Situation = tuple[str, str, frozenset[str]]


@dataclass(frozen=True, kw_only=True)
class Point:
    """One state, and what each action makes of it."""

    layout: int
    frames: list[Image]
    """How it looks; before it, how it looked from where the agent stood last, which shows what is under it now."""
    facts: Facts
    after: list[Facts]
    """Of each action."""


@dataclass
class _Snapshot:
    """A state that can be gone back to."""

    cells: list[Any]
    doors: list[tuple[Any, bool, bool]]
    carrying: Any
    position: tuple[int, int]
    direction: int
    moved_from: "_Snapshot | None" = None
    """The newest state before it with the agent elsewhere."""
    facts: Facts = field(default_factory=dict)


def points(game: Game, layout: int, *, draws: int, states: int, rng: np.random.Generator) -> list[Point]:
    """Draw states of a layout and ask what each action does there."""
    game.begin(layout)
    pools: dict[Situation, list[_Snapshot]] = {}
    for one in _explored(game, states, rng):
        pools.setdefault(situation(one.facts), []).append(one)
    chosen: list[_Snapshot] = []
    while pools and len(chosen) < draws:
        chosen.append(_drawn(pools, rng))
    return [_point(game, layout, one) for one in chosen]


def ahead(facts: Facts) -> str:
    """Return what is in front of the agent."""
    (row, column), (down, right) = facts["at"], AHEAD[facts["facing"]]
    return str(facts.get((row + down, column + right), "outside"))


def situation(facts: Facts) -> Situation:
    """Return what is in front, what is carried, and how doors are."""
    return ahead(facts), facts["carried"], frozenset(value for value in facts.values() if value in DOORS)


def _drawn(pools: dict[Situation, list[_Snapshot]], rng: np.random.Generator) -> _Snapshot:
    """Take a state out of one of the pools, each of which counts alike."""
    name = list(pools)[rng.integers(len(pools))]
    pool = pools[name]
    place = int(rng.integers(len(pool)))
    pool[place], pool[-1] = pool[-1], pool[place]
    one = pool.pop()
    if not pool:
        del pools[name]
    return one


def _point(game: Game, layout: int, one: _Snapshot) -> Point:
    after = [facts for _, facts in _outcomes(game, one)]
    shown = [one] if one.moved_from is None else [one.moved_from, one]
    return Point(layout=layout, frames=[_frame(game, each) for each in shown], facts=one.facts, after=after)


def _explored(game: Game, most: int, rng: np.random.Generator) -> list[_Snapshot]:
    """Return states that can be reached, in an order of chance; those where a game is over are left out."""
    world: Any = game.env.unwrapped
    start = _taken(world)
    start.facts = _facts(world, 0, ended=False)
    found, seen, waiting = [start], {_key(start.facts)}, {situation(start.facts): [start]}
    while waiting and len(found) < most:
        before = _drawn(waiting, rng)
        for after, facts in _outcomes(game, before):
            if facts["ended"] or _key(facts) in seen:
                continue
            seen.add(_key(facts))
            after.facts = facts
            after.moved_from = before if after.position != before.position else before.moved_from
            found.append(after)
            waiting.setdefault(situation(facts), []).append(after)
    return found


def _outcomes(game: Game, before: _Snapshot) -> Iterator[tuple[_Snapshot, Facts]]:
    """Yield what each action leads to."""
    world: Any = game.env.unwrapped
    world.gen_obs = dict  # nobody looks
    try:
        for action in range(game.n_actions):
            _back(world, before)
            _, reward, ended, _, _ = world.step(action)
            yield _taken(world), _facts(world, int(np.sign(reward)), ended=bool(ended))
    finally:
        del world.gen_obs


def _frame(game: Game, one: _Snapshot) -> Image:
    _back(game.env.unwrapped, one)
    return game.step(DONE).observation.frame


def _taken(world: Any) -> _Snapshot:
    doors = [
        (cell, cell.is_open, cell.is_locked) for cell in world.grid.grid if cell is not None and cell.type == "door"
    ]
    x, y = map(int, world.agent_pos)
    return _Snapshot(
        cells=list(world.grid.grid),
        doors=doors,
        carrying=world.carrying,
        position=(x, y),
        direction=int(world.agent_dir),
    )


def _back(world: Any, one: _Snapshot) -> None:
    world.grid.grid, world.carrying, world.step_count = list(one.cells), one.carrying, 0
    world.agent_pos, world.agent_dir = one.position, one.direction
    for door, is_open, is_locked in one.doors:
        door.is_open, door.is_locked = is_open, is_locked


def _facts(world: Any, gain: int, *, ended: bool) -> Facts:
    x, y = map(int, world.agent_pos)
    width = world.width
    cells = {divmod(place, width): _named(cell) for place, cell in enumerate(world.grid.grid)}
    carried = world.carrying.type if world.carrying else "nothing"
    return {"at": (y, x), "facing": int(world.agent_dir), "carried": carried, "gain": gain, "ended": ended, **cells}


def _named(cell: Any) -> str:
    if cell is None:
        return "empty"
    return DOORS[cell.encode()[2]] if cell.type == "door" else str(cell.type)


def _key(facts: Facts) -> tuple[Any, ...]:
    return tuple(facts.values())
