"""Operators of a discrete world, learned from play: what an action does, and what that depends on."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise

from semrl.planning.symbolic.cells import CellConcepts, GridEpisode, GridState

Offset = tuple[int, int]
"""Rows down and columns to the right, from the thing that the actions move."""

Literal = tuple[Offset | int, int]
"""An offset and the concept there; or a concept and whether there is one anywhere, 1 or 0."""

_REACH = 2
"""Cells that are looked at in each direction."""
_WIDEST = 4
"""Of the questions that tell most on their own, so many are paired with all others."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Effect:
    """What an action does."""

    move: Offset
    kind: int
    """How what the actions move looks then."""
    changes: tuple[tuple[Offset, int], ...] = ()
    """Cells, from where it stood, and the concept that each is of then."""
    gain: int = 0
    """Sign of the reward, where it is not always the same."""
    ends: bool = False
    """Whether the game ends."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Operator:
    """An action under some conditions."""

    action: int
    kind: int
    """How what the actions move looks before."""
    when: tuple[Literal, ...]
    effect: Effect
    support: int
    """Decisions of the play in which it was so."""
    against: int
    """Decisions in which the conditions held and something else came."""

    def applies(self, state: GridState, present: frozenset[int]) -> bool:
        """Tell whether the conditions hold, given the concepts that there are."""
        return state.kind == self.kind and all(_answer(state, present, ask) == told for ask, told in self.when)


@dataclass(frozen=True, kw_only=True)
class Operators:
    """All operators of a world."""

    operators: tuple[Operator, ...]
    asked: Mapping[tuple[int, int], tuple[Offset | int, ...]] = field(default_factory=dict)
    """Action and kind → what their operators ask of a state."""
    tried: frozenset[tuple[int, int, tuple[int, ...], frozenset[int]]] = frozenset()
    """Action, kind, concepts at all offsets that are asked about for this kind, and those that were there."""

    def successors(self, state: GridState) -> Iterator[tuple[Operator, GridState]]:
        """Yield the operators that apply in a state and what they make of it."""
        present = frozenset(_signed(state.cells))
        for operator in self.operators:
            if operator.applies(state, present):
                yield operator, applied(state, operator.effect)

    def untried(self, state: GridState, n_actions: int) -> list[int]:
        """Return the actions that were never tried where the cells that matter looked like this."""
        seen, present = self._context(state), frozenset(_signed(state.cells))
        return [action for action in range(n_actions) if (action, state.kind, seen, present) not in self.tried]

    def _context(self, state: GridState) -> tuple[int, ...]:
        return tuple(state.concept(offset) for offset in offsets_of(self.asked, state.kind))


def offsets_of(asked: Mapping[tuple[int, int], tuple[Offset | int, ...]], kind: int) -> list[Offset]:
    """Return all offsets that are asked about for a kind."""
    return sorted({ask for (_, own), asks in asked.items() if own == kind for ask in asks if isinstance(ask, tuple)})


def applied(state: GridState, effect: Effect) -> GridState:
    """Return the state after an effect."""
    cells = bytearray(state.cells)
    for (down, right), concept in effect.changes:
        cells[(state.row + down) * state.columns + state.column + right] = concept % 256
    return GridState(
        row=state.row + effect.move[0],
        column=state.column + effect.move[1],
        kind=effect.kind,
        cells=bytes(cells),
        columns=state.columns,
    )


def learn_operators(episodes: Sequence[GridEpisode], concepts: CellConcepts) -> Operators:
    """Learn from play what each action does.

    For each action and each way that what it moves looks, the fewest questions are chosen that tell its effects apart:
    of which concept a cell near it is, or whether there is a concept anywhere.
    """
    usual = Counter(reward for episode in episodes for reward in episode.rewards).most_common(1)
    samples: dict[tuple[int, int], Counter[tuple[GridState, Effect]]] = {}
    for episode in episodes:
        states = list(concepts.states(episode.grids))
        for i, (before, after) in enumerate(pairwise(states)):
            if before is None or after is None:
                continue
            reward = episode.rewards[i] if episode.rewards[i] != usual[0][0] else 0.0
            ends = episode.ended and i == len(episode.actions) - 1
            effect = _effect(before, after, (reward > 0) - (reward < 0), ends=ends)
            samples.setdefault((int(episode.actions[i]), before.kind), Counter())[before, effect] += 1
    asked = {key: _questions(own) for key, own in samples.items()}
    tried = {
        (key[0], key[1], tuple(state.concept(o) for o in offsets_of(asked, key[1])), frozenset(_signed(state.cells)))
        for key, own in samples.items()
        for state, _ in own
    }
    operators = [one for key, own in samples.items() for one in _operators(key, own, asked[key])]
    return Operators(operators=tuple(operators), asked=asked, tried=frozenset(tried))


def _effect(before: GridState, after: GridState, gain: int, *, ends: bool) -> Effect:
    changed = [
        (
            (place // before.columns - before.row, place % before.columns - before.column),
            new - 256 if new > 127 else new,
        )
        for place, (old, new) in enumerate(zip(before.cells, after.cells, strict=True))
        if old != new
    ]
    return Effect(
        move=(after.row - before.row, after.column - before.column),
        kind=after.kind,
        changes=tuple(changed),
        gain=gain,
        ends=ends,
    )


def _questions(samples: Counter[tuple[GridState, Effect]]) -> tuple[Offset | int, ...]:
    """Return the fewest and nearest questions whose answers tell the effects apart best."""
    effects = {effect for _, effect in samples}
    if len(effects) == 1:
        return ()
    offsets: list[Offset | int] = [
        (down, right) for down in range(-_REACH, _REACH + 1) for right in range(-_REACH, _REACH + 1)
    ]
    offsets.sort(key=lambda offset: sum(map(abs, offset)) if isinstance(offset, tuple) else 0)
    concepts = sorted({concept for state, _ in samples for concept in _signed(state.cells)})
    rows = [(state, frozenset(_signed(state.cells)), effect, count) for (state, effect), count in samples.items()]
    asks = [*offsets, *concepts]
    answers = [tuple(_answer(state, present, ask) for ask in asks) for state, present, _, _ in rows]

    def wrong(places: Sequence[int]) -> int:
        groups: dict[tuple[int, ...], Counter[Effect]] = {}
        for answer, (_, _, effect, count) in zip(answers, rows, strict=True):
            groups.setdefault(tuple(answer[i] for i in places), Counter())[effect] += count
        return sum(sum(group.values()) - max(group.values()) for group in groups.values())

    ones = sorted(range(len(asks)), key=lambda i: wrong((i,)))
    if wrong(()) == 0 or wrong((ones[0],)) == 0:
        return (asks[ones[0]],)
    pairs = [pair for pair in combinations(range(len(asks)), 2) if not set(pair).isdisjoint(ones[:_WIDEST])]
    best = min(pairs, key=wrong)
    return tuple(asks[i] for i in (best if wrong(best) < wrong((ones[0],)) else ones[:1]))


def _operators(
    key: tuple[int, int], samples: Counter[tuple[GridState, Effect]], asks: tuple[Offset | int, ...]
) -> Iterator[Operator]:
    groups: dict[tuple[int, ...], Counter[Effect]] = {}
    for (state, effect), count in samples.items():
        present = frozenset(_signed(state.cells))
        groups.setdefault(tuple(_answer(state, present, ask) for ask in asks), Counter())[effect] += count
    for answers, effects in groups.items():
        effect, support = effects.most_common(1)[0]
        yield Operator(
            action=key[0],
            kind=key[1],
            when=tuple(zip(asks, answers, strict=True)),
            effect=effect,
            support=support,
            against=effects.total() - support,
        )


def _answer(state: GridState, present: frozenset[int], ask: Offset | int) -> int:
    return state.concept(ask) if isinstance(ask, tuple) else int(ask in present)


def _signed(cells: bytes) -> set[int]:
    return {value - 256 if value > 127 else value for value in set(cells)}
