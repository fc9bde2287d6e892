"""Whether a class can have anything in it: a tableau for the profile, with the reason where it cannot.

It is sound: what it calls unsatisfiable is. It is not complete: it does not look through inverse and transitive roles,
and of ≤ n it sees only what contradicts ≥ m of the same. A description logic reasoner (extra ``dl``) finds the rest.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from semrl.core.errors import UsageError
from semrl.knowledge.expressions import (
    CONTAINS,
    NEGATED,
    And,
    AtLeast,
    AtMost,
    Bottom,
    Expression,
    Facet,
    Named,
    Not,
    Only,
    Or,
    Some,
    conjunction,
    negation_normal,
)
from semrl.knowledge.ontology import SCENE, Ontology, Sort
from semrl.knowledge.writing import write_condition

_MOST_BRANCHES = 20_000
"""After so many the search gives up, and takes the class to be satisfiable."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Contradiction:
    """Why a class cannot have anything in it: no part of this could be left out."""

    expression: Expression
    """What is left of it."""
    axioms: tuple[str, ...]
    """What is known that it contradicts, in words."""


def contradiction(expression: Expression, words: Ontology, sort: Sort = "scene") -> Contradiction | None:
    """Return why an expression is unsatisfiable; None where it is not, or not found to be."""
    if satisfiable(expression, words, sort):
        return None
    least = _least_axioms(expression, words, sort)
    shrinking = True
    while shrinking:
        smaller = next((one for one in _smaller(expression) if not satisfiable(one, least, sort)), None)
        shrinking = smaller is not None
        expression = smaller or expression
    least = _least_axioms(expression, least, sort)
    return Contradiction(expression=expression, axioms=tuple(asserted_axioms(least)))


def require_possible(expression: Expression, words: Ontology, what: str, sort: Sort = "scene") -> None:
    """Check that something can be of a class.

    Raises
    ------
    UsageError
        When nothing can; the message says why.
    """
    found = contradiction(expression, words, sort)
    if found is None:
        return
    said = write_condition(found.expression, words, sort)
    if not found.axioms:
        raise UsageError(f"{what} contradicts itself: {said}")
    raise UsageError(f"{what} cannot be had: {said}, but {', and '.join(found.axioms)}")


def satisfiable(expression: Expression, words: Ontology, sort: Sort = "scene") -> bool:
    """Tell whether something may be of an expression; True where the search gives up."""
    about = Named(SCENE) if sort == "scene" else Not(Named(SCENE))
    return _Tableau(words).holds((negation_normal(expression), about))


class _GaveUpError(Exception):
    """There were too many branches."""


class _Tableau:
    def __init__(self, words: Ontology) -> None:
        self.words = words
        self.branches = 0

    def holds(self, label: Iterable[Expression]) -> bool:
        """Tell whether an individual may be of all these, in negation normal form."""
        try:
            return self._open(label)
        except (_GaveUpError, RecursionError):
            return True

    def _open(self, label: Iterable[Expression]) -> bool:
        self.branches += 1
        if self.branches > _MOST_BRANCHES:
            raise _GaveUpError
        known, choices = self._saturated(label)
        if known is None:
            return False
        for choice in choices:
            if not any(part in known for part in choice.parts):
                return any(self._open((*known, part)) for part in choice.parts)
        return all(self._open(successor) for successor in self._successors(known))

    def _saturated(self, label: Iterable[Expression]) -> tuple[dict[Expression, None] | None, list[Or]]:
        """Return all that follows without a choice, and the choices; None where it contradicts itself."""
        known: dict[Expression, None] = {}
        choices, new = [], list(label)
        while new:
            one = new.pop()
            if one in known:
                continue
            known[one] = None
            new += self._follows(one)
            if isinstance(one, Or):
                choices.append(one)
        return (None if self._clashes(known) else known), choices

    def _follows(self, one: Expression) -> Sequence[Expression]:  # noqa: PLR0911 - one case a constructor
        definitions = self.words.definitions
        match one:
            case And(parts):
                return parts
            case Named(name) if name in definitions:
                return (negation_normal(definitions[name].expression),)
            case Not(Named(name)) if name in definitions:
                return (negation_normal(definitions[name].expression, negated=True),)
            case Named(name):
                return [Named(up) for up in self.words.above(name)]
            case AtMost(0, role, filler):
                return (Only(role, negation_normal(filler, negated=True)),)
            case AtLeast(number, role, filler) if number > 0:
                return (Some(role, filler),)
        return ()

    def _clashes(self, known: dict[Expression, None]) -> bool:
        names = {one.name for one in known if isinstance(one, Named)}
        if any(isinstance(one, Bottom) or (isinstance(one, Not) and one.part in known) for one in known):
            return True
        if any(len(names.intersection(group)) > 1 for group in self.words.disjoint):
            return True
        if SCENE in names and names.intersection(self.words.concepts):
            return True
        return self._numbers_clash(known, names) or self._counts_clash(known)

    def _numbers_clash(self, known: dict[Expression, None], names: set[str]) -> bool:
        facets = [one for one in known if isinstance(one, Facet)]
        for number in {facet.number for facet in facets}:
            bounds = [facet for facet in facets if facet.number == number]
            bounds += [
                _turned(one.part)
                for one in known
                if isinstance(one, Not) and isinstance(one.part, Facet) and one.part.number == number
            ]
            for (concept, of), (low, high) in self.words.ranges.items():
                if of == number and concept in names:
                    bounds += [Facet(number, ">=", low), Facet(number, "<=", high)]
            if _empty(bounds):
                return True
        return False

    def _counts_clash(self, known: dict[Expression, None]) -> bool:
        least = [one for one in known if isinstance(one, AtLeast)]
        for one in least:
            same = [other for other in known if isinstance(other, AtMost) and other.filler == one.filler]
            if any(other.role == one.role and other.number < one.number for other in same):
                return True
            most = [self.words.limits[name] for name in _named(one.filler) if name in self.words.limits]
            if one.role == CONTAINS and most and one.number > min(most):
                return True
        return False

    def _successors(self, known: dict[Expression, None]) -> Iterator[tuple[Expression, ...]]:
        """Yield what must hold of those that ∃ asks for; of what there is one only, all of it holds of that one."""
        only = [one for one in known if isinstance(one, Only)]
        single: dict[str, list[Expression]] = {}
        for one in known:
            if not isinstance(one, Some):
                continue
            label = [one.filler, *(each.filler for each in only if each.role == one.role), Not(Named(SCENE))]
            unique = [name for name in _named(one.filler) if self.words.limits.get(name) == 1]
            if one.role == CONTAINS and unique:
                single.setdefault(unique[0], []).extend(label)
            else:
                yield tuple(label)
        yield from (tuple(label) for label in single.values())


def _turned(facet: Expression) -> Facet:
    """Return what holds of a number that there is and that is not within a bound."""
    assert isinstance(facet, Facet)
    return replace(facet, comparison=NEGATED[facet.comparison])


def _empty(bounds: Sequence[Facet]) -> bool:
    low = max(((b.bound, b.comparison == ">") for b in bounds if b.comparison[0] == ">"), default=None)
    high = min(((b.bound, b.comparison != "<") for b in bounds if b.comparison[0] == "<"), default=None)
    if low is None or high is None:
        return False
    return low[0] > high[0] or (low[0] == high[0] and (low[1] or not high[1]))


def _named(filler: Expression) -> list[str]:
    """Return the atomic or defined classes that all of a filler are of, as far as it says so itself."""
    parts = filler.parts if isinstance(filler, And) else (filler,)
    return [part.name for part in parts if isinstance(part, Named)]


def _least_axioms(expression: Expression, words: Ontology, sort: Sort) -> Ontology:
    """Return the words without all axioms that the contradiction does not need."""
    for left_out in fewer(words):
        if not satisfiable(expression, replace(words, **left_out), sort):
            return _least_axioms(expression, replace(words, **left_out), sort)
    return words


def fewer(words: Ontology) -> Iterator[dict[str, Any]]:
    """Yield the fields of ontologies that say one thing less."""
    for name in ("ranges", "limits"):
        for key in getattr(words, name):
            yield {name: {k: v for k, v in getattr(words, name).items() if k != key}}
    for group in words.disjoint:
        others = tuple(one for one in words.disjoint if one != group)
        yield {"disjoint": others}
        if len(group) > 2:
            yield from ({"disjoint": (*others, pair)} for pair in combinations(group, 2))
    for pair in words.parents:
        yield {"parents": tuple(one for one in words.parents if one != pair)}


def asserted_axioms(words: Ontology) -> Iterator[str]:
    """Yield what is said of classes, in words."""
    for (concept, number), (low, high) in words.ranges.items():
        yield f"{concept}.{number} lies in {low:.4g} … {high:.4g}"
    for concept, most in words.limits.items():
        yield f"there is {most} {concept} at most"
    for group in words.disjoint:
        yield f"nothing is both {' and '.join(group)}"
    for low_class, up in words.parents:
        yield f"{low_class} is below {up}"


def _smaller(expression: Expression) -> Iterator[Expression]:
    """Yield expressions that say one thing less."""
    match expression:
        case And(parts):
            for i, part in enumerate(parts):
                yield conjunction(*parts[:i], *parts[i + 1 :])
                for less in _smaller(part):
                    yield conjunction(*parts[:i], less, *parts[i + 1 :])
        case Some(role, filler):
            yield from (Some(role, less) for less in _smaller(filler))
