"""Classes of scenes that are learned from play: before a loss (danger), before a gain (chance), as expressions.

A small tree over atoms is grown for each: where things stand, how they move, in which role to each other and to the
borders. Its leaves in which the reward mostly comes are written as a class expression, with support and error.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.errors import UsageError
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.consistency import satisfiable
from semrl.knowledge.expressions import (
    CONTAINS,
    And,
    Expression,
    Facet,
    HasValue,
    Named,
    Not,
    Or,
    Some,
    conjunction,
    disjunction,
)
from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.ontology import Definition, Ontology

DANGER, CHANCE = "Danger", "Chance"
"""Scenes in which a loss, and in which a gain, is soon to come."""

_Way: TypeAlias = tuple[int, ...]
"""Answers on the way to a leaf: ``k`` where question k is answered with yes, ``~k`` where with no."""

_CUTS = 16
"""Bounds that are tried of each number, at its quantiles."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneClassesConfig:
    """How classes of scenes are learned."""

    within_decisions: int = 15
    """How soon the reward must come."""
    leaves: int = 8
    """Most leaves of a tree."""
    least_rewards: int = 3
    """Fewest rewards of a kind from which its class is learned."""
    least_decisions: int = 10
    """Fewest decisions in a leaf."""
    purity: float = 0.9
    """Share of a leaf's decisions before a reward, above which it counts: the reward comes whatever is done."""

    def __post_init__(self) -> None:
        if not 0 < self.purity < 1:
            raise UsageError(f"purity must lie between 0 and 1, not be {self.purity}")
        for name in ("within_decisions", "leaves", "least_rewards", "least_decisions"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} must be 1 or more, not {getattr(self, name)}")


@dataclass(frozen=True, slots=True)
class Atom:
    """A question about a scene, and what is known where it is answered with yes and with no."""

    yes: Expression
    no: Expression


def soon(rewards: Sequence[Floats], sign: int, within: int) -> NDArray[np.bool_]:
    """Return of each decision whether a reward of a sign comes in it or shortly after, episode behind episode.

    Parameters
    ----------
    rewards
        Of each episode, ``(t,)``.
    sign
        −1 or 1.
    within
        In how many decisions it must come, counted from this one on.
    """
    flags = []
    for own in rewards:
        counts = np.append(0, np.cumsum(np.sign(own) == sign))
        places = np.arange(len(own))
        flags.append(counts[np.minimum(places + within, len(own))] > counts[places])
    return np.concatenate(flags) if flags else np.zeros(0, np.bool_)


def learn_scene_classes(
    words: Ontology, scenes: Interpretation, rewards: Sequence[Floats], config: SceneClassesConfig
) -> dict[str, Definition]:
    """Learn what scenes before a loss and before a gain are like.

    Parameters
    ----------
    words
        The ontology; a leaf that contradicts it is left out.
    scenes
        Of each decision, episode behind episode.
    rewards
        Of each episode, ``(t,)``.
    config
        See `SceneClassesConfig`.

    Returns
    -------
    dict
        `DANGER` and `CHANCE`, those for which there was enough to learn from and in which something may be.
    """
    atoms = list(_atoms(words, scenes))
    if not atoms:
        return {}
    table = _ask(words, scenes, [atom.yes for atom in atoms])
    found = {}
    for name, sign, what in ((DANGER, -1, "A loss"), (CHANCE, 1, "A gain")):
        if sum(int((np.sign(own) == sign).sum()) for own in rewards) < config.least_rewards:
            continue
        comes = soon(rewards, sign, config.within_decisions)
        paths = _shortened(_leaves(table, comes, config), table, comes)
        rules = [conjunction(*_shortest([_literal(atoms, step) for step in path])) for path in paths]
        rules = [rule for rule in rules if satisfiable(rule, words)]
        if not rules:
            continue
        expression = disjunction(*rules)
        holds = _ask(words, scenes, [expression])[:, 0]
        comment = f"{what} nearly always comes within {config.within_decisions} decisions."
        found[name] = Definition(
            expression=expression,
            comment=comment,
            support=int(holds.sum()),
            error=float((holds != comes).mean()),
            origin="learned",
        )
    return found


def _atoms(words: Ontology, scenes: Interpretation) -> Iterator[Atom]:
    """Yield all questions about what a scene contains, and about the numbers and roles of it."""
    higher = {up for low, up in words.parents if low != up}
    borders = set(words.individuals.values())
    kinds = [name for name in words.concepts if name not in higher | borders]
    inverses = {role.inverse for role in words.roles if role.inverse and role.inverse > role.name}
    for kind in kinds:
        yield _asked(kind)
        places = scenes.classes[:, list(words.concepts).index(kind)] & scenes.present
        for i, number in enumerate(words.numbers):
            for bound in _bounds(scenes.numbers[:, i][places]):
                lower, upper = Facet(number, "<=", bound), Facet(number, ">", bound)
                yield Atom(_asked(kind, upper).yes, _asked(kind, lower).yes)
        for role in words.roles:
            others = [other for other in kinds if other != kind and not (role.symmetric and other < kind)]
            if role.name not in inverses:
                yield from (_asked(kind, Some(role.name, Named(other))) for other in others)
                yield from (_asked(kind, HasValue(role.name, border)) for border in words.individuals)


def _asked(kind: str, *said: Expression) -> Atom:
    """Return the question whether a scene contains something of a kind of which something holds."""
    contained = Some(CONTAINS, conjunction(Named(kind), *said))
    return Atom(contained, Not(contained))


def _bounds(values: NDArray[np.float64]) -> list[float]:
    """Return bounds at the quantiles of a number, as short as tells them apart."""
    values = values[np.isfinite(values)]
    if not len(values) or values.min() == values.max():
        return []
    middle = np.quantile(values, np.linspace(0, 1, _CUTS + 2)[1:-1])
    return [float(bound) for bound in np.unique(np.round(middle, 1))]


def _ask(words: Ontology, scenes: Interpretation, questions: Sequence[Expression]) -> NDArray[np.bool_]:
    """Return what holds in which scene, ``(b, q)``."""
    named = {f"_{i}": question for i, question in enumerate(questions)}
    return Classifier(words, named).of_scenes(scenes, list(named))


def _leaves(table: NDArray[np.bool_], comes: NDArray[np.bool_], config: SceneClassesConfig) -> list[_Way]:
    """Grow a tree, the best cut first (Gini); return the ways to its leaves in which the reward mostly comes."""
    answers, wanted = table.astype(np.float32), comes.astype(np.float32)
    open_leaves: list[tuple[list[int], NDArray[np.int64]]] = [([], np.arange(len(comes)))]
    cuts = [_best_cut(answers, wanted, config.least_decisions)]
    while len(open_leaves) < config.leaves and max(gain for gain, _ in cuts) > 0:
        place = int(np.argmax([gain for gain, _ in cuts]))
        (way, rows), (_, atom) = open_leaves.pop(place), cuts.pop(place)
        for step, part in ((atom, rows[table[rows, atom]]), (~atom, rows[~table[rows, atom]])):
            open_leaves.append(([*way, step], part))
            cuts.append(_best_cut(answers[part], wanted[part], config.least_decisions))
    return [tuple(way) for way, rows in open_leaves if way and comes[rows].mean() > config.purity]


def _shortened(ways: list[_Way], table: NDArray[np.bool_], comes: NDArray[np.bool_]) -> list[_Way]:
    """Leave out answers, and whole ways, without which no more decisions are classified wrongly."""

    def wrong(some: Sequence[_Way]) -> int:
        held = np.zeros(len(comes), np.bool_)
        for way in some:
            held |= np.all([table[:, step] if step >= 0 else ~table[:, ~step] for step in way], axis=0)
        return int((held != comes).sum())

    least, shrinking = wrong(ways), True
    while shrinking:
        smaller = (
            [*ways[:i], *([rest] if rest else []), *ways[i + 1 :]]
            for i, way in enumerate(ways)
            for rest in ((), *(tuple(step for step in way if step != out) for out in way))
        )
        found = next((some for some in smaller if wrong(some) <= least), None)
        shrinking = found is not None and len(ways) > 0
        if found is not None:
            ways, least = found, wrong(found)
    return ways


def _best_cut(answers: Floats, wanted: Floats, least: int) -> tuple[float, int]:
    """Return by how much a cut lowers the impurity at best, and the question that does."""
    n, total = len(wanted), float(wanted.sum())
    yes, hits = answers.sum(axis=0), wanted @ answers  # (q,)
    no, missed = n - yes, total - hits
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = hits**2 / yes + missed**2 / no - total**2 / n
    gains = np.where((yes >= least) & (no >= least), gains, 0.0)
    best = int(np.argmax(gains))
    return (float(gains[best]) if gains[best] > 1e-3 else 0.0), best


def _literal(atoms: Sequence[Atom], step: int) -> Expression:
    return atoms[step].yes if step >= 0 else atoms[~step].no


def _shortest(literals: Sequence[Expression]) -> list[Expression]:
    """Leave out the bounds of a number that a narrower one implies."""
    narrowest: dict[object, Expression] = {}
    for literal in literals:
        match literal:
            case Some(_, And((Named(kind), Facet(number, comparison, bound)))):
                key = kind, number, comparison
                before = narrowest.get(key)
                if before is None or (bound > _bound(before)) == (comparison == ">"):
                    narrowest[key] = literal
            case _:
                narrowest[literal] = literal
    return list(narrowest.values())


def _bound(literal: Expression) -> float:
    assert isinstance(literal, Some)
    assert isinstance(literal.filler, And)
    facet = literal.filler.parts[1]
    assert isinstance(facet, Facet)
    return facet.bound


def shuffled(words: Ontology, names: Sequence[str], *, disabled: Collection[str] = (), seed: int = 0) -> Ontology:
    """Return words in which the rules of some classes are dealt out among these classes by chance.

    Each class has as many as before; where only one has any, another one gets them all. Rules of classes that are
    disabled are left out. It is what learned classes are compared with.
    """
    defined = [name for name in names if name in words.definitions and name not in disabled]
    rules = [(name, rule) for name in defined for rule in _rules(words.definitions[name].expression)]
    owners = [name for name, _ in rules]
    if len(defined) > 1:
        rng = np.random.default_rng(seed)
        dealt = owners
        while dealt == owners:  # there are two owners, so that another deal comes
            dealt = [owners[i] for i in rng.permutation(len(rules))]
        owners = dealt
    else:
        owners = [next(name for name in names if name != owner) for owner in owners]
    changed = {
        name: replace(
            words.definitions.get(name, words.definitions[defined[0]]),
            expression=disjunction(*(rule for (_, rule), owner in zip(rules, owners, strict=True) if owner == name)),
        )
        for name in names
    }
    return words.having(**changed)


def _rules(expression: Expression) -> tuple[Expression, ...]:
    return expression.parts if isinstance(expression, Or) else (expression,)
