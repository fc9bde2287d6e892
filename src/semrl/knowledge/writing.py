"""Class expressions as text: as a condition, and in OWL's Manchester syntax."""

from semrl.knowledge.expressions import (
    CONTAINS,
    And,
    AtLeast,
    AtMost,
    Bottom,
    Expression,
    Facet,
    HasSelf,
    HasValue,
    Named,
    Not,
    Only,
    Or,
    Some,
    Top,
)
from semrl.knowledge.ontology import Ontology, Sort

_TIGHT, _LOOSE = True, False


def write_condition(expression: Expression, words: Ontology, sort: Sort = "scene") -> str:
    """Write a class expression as a condition, which `read_condition` reads as an equal expression."""
    return _condition(expression, words, sort, _LOOSE)


def _condition(  # noqa: PLR0911 - one case a constructor
    expression: Expression, words: Ontology, sort: Sort, tight: bool
) -> str:
    def inner(filler: Expression) -> str:
        return _condition(filler, words, "thing", _LOOSE)

    match expression:
        case And(parts):
            text = _conjunction(parts, words, sort)
        case Or(parts):
            text = " or ".join(_condition(part, words, sort, _TIGHT) for part in parts)
        case Not(part):
            return f"not {_condition(part, words, sort, _TIGHT)}"
        case Top() | Bottom():
            return "true" if isinstance(expression, Top) else "false"
        case Named(name):
            return name
        case Facet(number, comparison, bound):
            return f"{number} {comparison} {bound!r}"
        case Some(role, filler):
            return (sort == "scene" and _of_a_thing(role, filler, words)) or f"some({role}, {inner(filler)})"
        case Only(role, filler):
            return f"only({role}, {inner(filler)})"
        case AtLeast(number, role, filler) | AtMost(number, role, filler):
            name = "at_least" if isinstance(expression, AtLeast) else "at_most"
            return f"{name}({number}, {role}, {inner(filler)})"
        case HasValue(role, individual):
            return f"value({role}, {individual})"
        case HasSelf(role):
            return f"itself({role})"
    return f"({text})" if tight else text


def _conjunction(parts: tuple[Expression, ...], words: Ontology, sort: Sort) -> str:
    """Write what stands between ``and``: the short form once a name, as it says all of one thing."""
    texts, said = [], set()
    for part in parts:
        text = _condition(part, words, sort, _TIGHT)
        subject = text.partition(" ")[0].partition(".")[0]
        if isinstance(part, Some) and part.role == CONTAINS and not text.startswith(("some(", "(")):
            if subject in said:
                text = f"some({CONTAINS}, {_condition(part.filler, words, 'thing', _LOOSE)})"
            said.add(subject)
        texts.append(text)
    return " and ".join(texts)


def _of_a_thing(role: str, filler: Expression, words: Ontology) -> str:
    """Write ``own.y <= 33.0`` or ``near(own, ball)`` where that is all that is said, else nothing."""
    if role != CONTAINS:
        return ""
    match filler:
        case Named(name) if words.sort(name) == "thing":
            return name
        case And((Named(name), Facet(number, comparison, bound))) if words.sort(name) == "thing":
            return f"{name}.{number} {comparison} {bound!r}"
        case And((Named(name), Some(to, Named(other)))) if {words.sort(name), words.sort(other)} == {"thing"}:
            return "" if to == CONTAINS else f"{to}({name}, {other})"
        case And((Named(name), HasValue(to, other))) if words.sort(name) == "thing" and other in words.individuals:
            return f"{to}({name}, {other})"
    return ""


def write_manchester(expression: Expression) -> str:
    """Write a class expression in Manchester syntax, which `read_manchester` reads as an equal expression."""
    return _manchester(expression, _LOOSE)


def _manchester(expression: Expression, tight: bool) -> str:
    match expression:
        case Named(name):
            return name
        case Top() | Bottom():
            return "owl:Thing" if isinstance(expression, Top) else "owl:Nothing"
        case Not(part):
            return f"not {_manchester(part, _TIGHT)}"
        case And(parts) | Or(parts):
            text = (" and " if isinstance(expression, And) else " or ").join(_manchester(p, _TIGHT) for p in parts)
        case Some(role, filler):
            text = f"{role} some {_manchester(filler, _TIGHT)}"
        case Only(role, filler):
            text = f"{role} only {_manchester(filler, _TIGHT)}"
        case AtLeast(number, role, filler):
            text = f"{role} min {number} {_manchester(filler, _TIGHT)}"
        case AtMost(number, role, filler):
            text = f"{role} max {number} {_manchester(filler, _TIGHT)}"
        case HasValue(role, individual):
            text = f"{role} value {individual}"
        case HasSelf(role):
            text = f"{role} Self"
        case Facet(number, comparison, bound):
            text = f'{number} some xsd:double[{comparison} "{bound!r}"^^xsd:double]'
    return f"({text})" if tight else text
