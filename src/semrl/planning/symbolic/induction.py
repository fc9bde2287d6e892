"""Learning operators from play: the fewest questions whose answers determine what an action does."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from semrl.core import Ints
from semrl.planning.symbolic.cells import CellConcepts, GridEpisode, GridState
from semrl.planning.symbolic.operators import Ask, Effect, Literal, Operator, Operators, answer, signed
from semrl.planning.symbolic.turning import Offset, Turning, learn_turning, turned_offset

_REACH = 2
"""Cells that are looked at in each direction."""
_NEAR = 1
"""Cells so far away are asked about before what is anywhere, farther ones after it."""

_OPERATOR_COST = 0.05
"""Decisions that an operator must predict right to be worth having; so few that what was seen once counts."""

_Key = tuple[int, int]
_Samples = Counter[tuple[GridState, Effect]]


def learn_operators(episodes: Sequence[GridEpisode], concepts: CellConcepts) -> Operators:
    """Learn from play what each action does.

    For each action and each way that what it moves looks, the fewest questions are chosen that tell its effects apart:
    of which concept a cell near it is, or whether there is a concept anywhere. Ways that are turns of one another are
    learned as one.
    """
    taken = list(_taken(episodes, concepts))
    turning = learn_turning(set(concepts.own.values()), ((before.kind, effect.move) for _, before, effect in taken))
    samples: dict[_Key, _Samples] = {}
    for action, before, effect in taken:
        quarters, state = turning.of(before.kind), turning.turned_state(before)
        samples.setdefault((action, state.kind), Counter())[state, _turned(effect, turning, -quarters)] += 1
    asked = {key: _questions(own) for key, own in samples.items()}
    operators = [
        one
        for key, own in samples.items()
        for operator in _operators(key, own, asked[key])
        for one in _all_ways(operator, turning)
    ]
    known = frozenset(concepts.concept_of.values())
    learned = Operators(operators=tuple(operators), asked=asked, concepts=known, turning=turning)
    contexts = {(action, learned.context(before)) for action, before, _ in taken}
    return replace(learned, tried=frozenset(trial for one in contexts for trial in learned.met(*one)))


def _taken(episodes: Sequence[GridEpisode], concepts: CellConcepts) -> Iterator[tuple[int, GridState, Effect]]:
    """Yield each action of the play, the state before it and what it did."""
    usual = Counter(reward for episode in episodes for reward in episode.rewards).most_common(1)
    for episode in episodes:
        for i, (before, after) in enumerate(pairwise(concepts.states(episode.grids))):
            if before is None or after is None:
                continue
            reward = episode.rewards[i] if episode.rewards[i] != usual[0][0] else 0.0
            ends = episode.ended and i == len(episode.actions) - 1
            yield int(episode.actions[i]), before, _effect(before, after, (reward > 0) - (reward < 0), ends=ends)


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


def _turned(effect: Effect, turning: Turning, quarters: int) -> Effect:
    return replace(
        effect,
        move=turned_offset(effect.move, quarters),
        kind=turning.turned_kind(effect.kind, quarters),
        changes=tuple(sorted((turned_offset(offset, quarters), concept) for offset, concept in effect.changes)),
    )


def _all_ways(operator: Operator, turning: Turning) -> Iterator[Operator]:
    """Yield an operator for each way to face that is a turn of its own."""
    if operator.kind not in turning.quarters:
        yield operator
        return
    for kind, quarters in turning.quarters.items():
        when: list[Literal] = [
            (turned_offset(ask, quarters) if isinstance(ask, tuple) else ask, value) for ask, value in operator.when
        ]
        yield replace(operator, kind=kind, when=tuple(when), effect=_turned(operator.effect, turning, quarters))


def _questions(samples: _Samples) -> tuple[Ask, ...]:
    """Return the fewest and nearest questions whose answers tell the effects apart best."""
    effects = {effect: number for number, effect in enumerate({effect: None for _, effect in samples})}
    if len(effects) == 1:
        return ()
    asks = _asks(samples)
    answers = np.array([[answer(state, signed(state.cells), ask) for ask in asks] for state, _ in samples], np.int64)
    outcomes = np.array([effects[effect] for _, effect in samples])
    counts = np.array(list(samples.values()))

    def wrong(*places: int) -> float:
        return _wrong(answers[:, list(places)], outcomes, counts)

    first = min(range(len(asks)), key=wrong)
    if wrong(first) < 1:
        return (asks[first],)
    best = min(combinations(range(len(asks)), 2), key=lambda pair: wrong(*pair))
    return tuple(asks[i] for i in best) if wrong(*best) < wrong(first) else (asks[first],)


def _asks(samples: _Samples) -> list[Ask]:
    """Return all questions, those first that are asked rather than others that say as much."""
    offsets: list[Offset] = [
        (down, right) for down in range(-_REACH, _REACH + 1) for right in range(-_REACH, _REACH + 1)
    ]
    offsets.sort(key=lambda offset: sum(map(abs, offset)))
    concepts = sorted({concept for state, _ in samples for concept in signed(state.cells)})
    near = [offset for offset in offsets if sum(map(abs, offset)) <= _NEAR]
    return [*near, *concepts, *offsets[len(near) :]]


def _wrong(answers: Ints, outcomes: Ints, counts: Ints) -> float:
    """Return how many samples have another effect than most with the same answers, and what the answers cost."""
    lowest, most = answers.min(axis=0), int(outcomes.max()) + 1
    widths = answers.max(axis=0) - lowest + 1
    group = np.ravel_multi_index(tuple((answers - lowest).T), tuple(widths))
    table = np.bincount(group * most + outcomes, weights=counts, minlength=int(widths.prod()) * most).reshape(-1, most)
    likeliest = table.max(axis=1)
    return float(counts.sum() - likeliest.sum()) + _OPERATOR_COST * int((likeliest > 0).sum())


def _operators(key: _Key, samples: _Samples, asks: tuple[Ask, ...]) -> Iterator[Operator]:
    groups: dict[tuple[int, ...], Counter[Effect]] = {}
    for (state, effect), count in samples.items():
        present = signed(state.cells)
        groups.setdefault(tuple(answer(state, present, ask) for ask in asks), Counter())[effect] += count
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
