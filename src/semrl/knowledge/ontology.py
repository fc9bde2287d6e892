"""The words of a run: classes, roles and numbers, what is said of them, and definitions of classes (§2.4)."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Self

from semrl.core.errors import UsageError
from semrl.knowledge.expressions import (
    CONTAINS,
    AtLeast,
    AtMost,
    Expression,
    Facet,
    HasSelf,
    HasValue,
    Named,
    Only,
    Some,
    classes_of,
    substituted,
    walk,
)

Sort = Literal["scene", "thing"]
"""What a class is about."""

SCENE = "Scene"
"""The class of scenes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Role:
    """An object property, and what is said of it."""

    name: str
    inverse: str = ""
    symmetric: bool = False
    transitive: bool = False
    chains: tuple[tuple[str, str], ...] = ()
    """Pairs of roles, one after the other, which this one follows from."""
    comment: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Definition:
    """A class that is defined by an expression."""

    expression: Expression
    sort: Sort = "scene"
    comment: str = ""
    support: int = 0
    """Decisions of the play that it was learned from and holds in; 0 where it was not learned."""
    error: float = 0.0
    """Share of the decisions at which what it stands for and what it says differ."""
    origin: str = "asserted"
    """Where it is from: ``learned`` from play, or ``asserted`` by people."""


@dataclass(frozen=True, kw_only=True)
class Ontology:
    """What there is and what is said of it: a TBox and an RBox.

    Examples
    --------
    >>> from semrl.knowledge.expressions import Facet, Named, Some, conjunction
    >>> words = Ontology(concepts={"ball": "A thing."}, numbers={"x": "Centre."})
    >>> words.check(Some("contains", conjunction(Named("ball"), Facet("x", "<", 50.0))))
    """

    concepts: Mapping[str, str]
    """Atomic classes of things, and what each is."""
    parents: tuple[tuple[str, str], ...] = ()
    """Pairs of atomic classes: the first is below the second."""
    disjoint: tuple[tuple[str, ...], ...] = ()
    """Groups of atomic classes, of which nothing is of two."""
    roles: tuple[Role, ...] = ()
    numbers: Mapping[str, str] = field(default_factory=dict)
    """Data properties, each of one xsd:double, and what each is."""
    individuals: Mapping[str, str] = field(default_factory=dict)
    """Individuals with a name, and the class of each."""
    definitions: Mapping[str, Definition] = field(default_factory=dict)
    """Defined classes."""
    ranges: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    """Concept and number → between which bounds it lies, as play bears out."""
    limits: Mapping[str, int] = field(default_factory=dict)
    """Concept → how many of it a scene has at most."""

    @cached_property
    def role_names(self) -> tuple[str, ...]:
        """Names of all roles: `contains`, then those asserted, then inverses that were not asserted themselves."""
        asserted = [CONTAINS, *(role.name for role in self.roles)]
        return tuple(dict.fromkeys([*asserted, *(role.inverse for role in self.roles if role.inverse)]))

    @cached_property
    def class_names(self) -> tuple[str, ...]:
        """Names of all classes."""
        return SCENE, *self.concepts, *self.definitions

    def sort(self, name: str) -> Sort:
        """Return what a class is about."""
        if name == SCENE:
            return "scene"
        return self.definitions[name].sort if name in self.definitions else "thing"

    def having(self, **definitions: Definition) -> Self:
        """Return the same words and some more definitions.

        Raises
        ------
        UsageError
            When a name is taken by something else, or a definition uses unknown words or, in the end, itself.
        """
        for name in definitions:
            if name in {SCENE, *self.concepts, *self.role_names, *self.numbers, *self.individuals}:
                raise UsageError(f"'{name}' cannot be defined: it is a word of the run already")
        more = replace(self, definitions={**self.definitions, **definitions})
        for definition in definitions.values():
            more.check(definition.expression)
        more.ordered()
        return more

    def check(self, expression: Expression) -> None:
        """Check that all words of an expression are known.

        Raises
        ------
        UsageError
            When one is not; the message names the closest that is.
        """
        for part in walk(expression):
            match part:
                case Named(name):
                    known(name, self.class_names, "class")
                case Some(role, _) | Only(role, _) | AtLeast(_, role, _) | AtMost(_, role, _) | HasSelf(role):
                    known(role, self.role_names, "role")
                case HasValue(role, individual):
                    known(role, self.role_names, "role")
                    known(individual, self.individuals, "individual")
                case Facet(number, _, _):
                    known(number, self.numbers, "number")

    def ordered(self) -> list[str]:
        """Return the defined classes so that each stands behind those that it is defined by.

        Raises
        ------
        UsageError
            When there is a cycle, which the message names.
        """
        done: dict[str, None] = {}
        for name in self.definitions:
            self._visit(name, (), done)
        return list(done)

    def _visit(self, name: str, path: tuple[str, ...], done: dict[str, None]) -> None:
        if name in path:
            cycle = " → ".join([*path[path.index(name) :], name])
            raise UsageError(f"the definition of '{name}' is cyclic: {cycle}")
        if name in done or name not in self.definitions:
            return
        for used in classes_of(self.definitions[name].expression):
            self._visit(used, (*path, name), done)
        done[name] = None

    def unfolded(self, expression: Expression) -> Expression:
        """Return an expression with defined classes replaced by what they are defined as."""
        used = [name for name in classes_of(expression) if name in self.definitions]
        return substituted(expression, {name: self.unfolded(self.definitions[name].expression) for name in used})

    def above(self, name: str) -> tuple[str, ...]:
        """Return an atomic class and all that are asserted to be above it."""
        found, new = {name: None}, [name]
        while new:
            lower = new.pop()
            more = [up for low, up in self.parents if low == lower and up not in found]
            found |= dict.fromkeys(more)
            new += more
        return tuple(found)


def known(name: str, names: Iterable[str], what: str) -> None:
    """Check that a word is one of some.

    Raises
    ------
    UsageError
        When it is not; the message names the closest one, or all.
    """
    names = tuple(names)
    if name in names:
        return
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"; did you mean '{close[0]}'?" if close else f"; there are {', '.join(names)}" if names else ""
    raise UsageError(f"there is no {what} '{name}'{hint}")
