"""Class expressions: the part of OWL 2 DL (§2.4) that scenes are classified by and goals are written in.

An expression says of a thing, or of the scene as a whole, whether it is of a class. What a scene does not show is
taken to be false (closed world): that is what makes ¬, ∀ and ≤ n decidable on a single scene.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

Comparison = Literal["<", "<=", ">", ">="]

CONTAINS = "contains"
"""The role from a scene to its things."""


@dataclass(frozen=True, slots=True)
class Named:
    """A class by name: atomic, or defined by another expression."""

    name: str


@dataclass(frozen=True, slots=True)
class Top:
    """Everything (⊤)."""


@dataclass(frozen=True, slots=True)
class Bottom:
    """Nothing (⊥)."""


@dataclass(frozen=True, slots=True)
class And:
    """What is of all parts (⊓), two or more."""

    parts: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Or:
    """What is of some part (⊔), two or more."""

    parts: tuple["Expression", ...]


@dataclass(frozen=True, slots=True)
class Not:
    """What is not of a class (¬)."""

    part: "Expression"


@dataclass(frozen=True, slots=True)
class Some:
    """What has a role to something of a class (∃)."""

    role: str
    filler: "Expression"


@dataclass(frozen=True, slots=True)
class Only:
    """What has a role to nothing but things of a class (∀)."""

    role: str
    filler: "Expression"


@dataclass(frozen=True, slots=True)
class AtLeast:
    """What has a role to so many different things of a class, or more (≥ n)."""

    number: int
    role: str
    filler: "Expression"


@dataclass(frozen=True, slots=True)
class AtMost:
    """What has a role to so many different things of a class, or fewer (≤ n)."""

    number: int
    role: str
    filler: "Expression"


@dataclass(frozen=True, slots=True)
class HasValue:
    """What has a role to an individual that has a name."""

    role: str
    individual: str


@dataclass(frozen=True, slots=True)
class HasSelf:
    """What has a role to itself."""

    role: str


@dataclass(frozen=True, slots=True)
class Facet:
    """What has a number, of type xsd:double, on one side of a bound."""

    number: str
    comparison: Comparison
    bound: float


Expression: TypeAlias = (
    Named | Top | Bottom | And | Or | Not | Some | Only | AtLeast | AtMost | HasValue | HasSelf | Facet
)

NEGATED: dict[Comparison, Comparison] = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""Comparison → the one that holds of a number where it does not."""


def conjunction(*parts: Expression) -> Expression:
    """Return what is of all parts: nested ones are joined, equal ones said once."""
    flat = tuple(dict.fromkeys(one for part in parts for one in (part.parts if isinstance(part, And) else (part,))))
    return And(flat) if len(flat) > 1 else flat[0] if flat else Top()


def disjunction(*parts: Expression) -> Expression:
    """Return what is of some part: nested ones are joined, equal ones said once."""
    flat = tuple(dict.fromkeys(one for part in parts for one in (part.parts if isinstance(part, Or) else (part,))))
    return Or(flat) if len(flat) > 1 else flat[0] if flat else Bottom()


def children(expression: Expression) -> tuple[Expression, ...]:
    """Return the expressions that one is made of."""
    match expression:
        case And(parts) | Or(parts):
            return parts
        case Not(part):
            return (part,)
        case Some(_, filler) | Only(_, filler) | AtLeast(_, _, filler) | AtMost(_, _, filler):
            return (filler,)
    return ()


def walk(expression: Expression) -> Iterator[Expression]:
    """Yield an expression and all that it is made of."""
    yield expression
    for part in children(expression):
        yield from walk(part)


def classes_of(expression: Expression) -> tuple[str, ...]:
    """Return the classes that an expression names, each once."""
    return tuple(dict.fromkeys(part.name for part in walk(expression) if isinstance(part, Named)))


def substituted(expression: Expression, classes: Mapping[str, Expression]) -> Expression:
    """Return an expression with some classes replaced by others."""
    if isinstance(expression, Named):
        return classes.get(expression.name, expression)
    parts = tuple(substituted(part, classes) for part in children(expression))
    match expression:
        case And() | Or():
            return replace(expression, parts=parts)
        case Not():
            return Not(parts[0])
        case Some() | Only() | AtLeast() | AtMost():
            return replace(expression, filler=parts[0])
    return expression


def negation_normal(  # noqa: PLR0911 - one case a constructor
    expression: Expression, *, negated: bool = False
) -> Expression:
    """Return an equal expression, or the complement of one, in which ¬ stands before names, roles and numbers only.

    Notes
    -----
    A number that is not there satisfies no facet, so that ¬ stays before facets.
    """
    match expression:
        case Not(part):
            return negation_normal(part, negated=not negated)
        case And(parts) | Or(parts):
            inner = tuple(negation_normal(part, negated=negated) for part in parts)
            return And(inner) if isinstance(expression, And) != negated else Or(inner)
        case Some(role, filler) if negated:
            return Only(role, negation_normal(filler, negated=True))
        case Only(role, filler) if negated:
            return Some(role, negation_normal(filler, negated=True))
        case Some(role, filler):
            return Some(role, negation_normal(filler))
        case Only(role, filler):
            return Only(role, negation_normal(filler))
        case AtLeast(number, role, filler) | AtMost(number, role, filler):
            return _counted(isinstance(expression, AtLeast) != negated, number, role, negation_normal(filler), negated)
        case Top() if negated:
            return Bottom()
        case Bottom() if negated:
            return Top()
    return Not(expression) if negated else expression


def _counted(least: bool, number: int, role: str, filler: Expression, negated: bool) -> Expression:
    """Return ≥ or ≤ with the number that a negation makes of it; ¬ ≥ 0 is nothing."""
    if not negated:
        return AtLeast(number, role, filler) if least else AtMost(number, role, filler)
    if least:
        return AtLeast(number + 1, role, filler)
    return AtMost(number - 1, role, filler) if number else Bottom()
