"""Conditions as people write them: ``own.y <= 33 and ball.x < 50``, read with Python's parser and never evaluated."""

import ast
from collections.abc import Callable

from semrl.core.errors import UsageError
from semrl.knowledge.expressions import (
    CONTAINS,
    AtLeast,
    AtMost,
    Bottom,
    Comparison,
    Expression,
    Facet,
    HasSelf,
    HasValue,
    Named,
    Not,
    Only,
    Some,
    Top,
    conjunction,
    disjunction,
)
from semrl.knowledge.ontology import Ontology, Sort, known

MAX_CHARACTERS = 10_000
"""Longest condition that is read."""

ORDER = {("x", "<"): "leftOf", ("x", ">"): "rightOf", ("y", "<"): "above", ("y", ">"): "below"}
"""Number and comparison of two things → the role that says the same."""

_COMPARISONS: dict[type[ast.cmpop], Comparison] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_TURNED: dict[Comparison, Comparison] = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_QUANTIFIERS: dict[str, Callable[[str, Expression], Expression]] = {"some": Some, "only": Only}
_NUMBERED: dict[str, Callable[[int, str, Expression], Expression]] = {"at_least": AtLeast, "at_most": AtMost}

GRAMMAR = "write it like  own.y <= 33 and ball.x < 50"


def tree_of(text: str) -> ast.expr:
    """Read a text as Python would; nothing is evaluated.

    Raises
    ------
    UsageError
        When it is no expression.
    """
    if len(text) > MAX_CHARACTERS:
        raise UsageError(f"the condition has {len(text):,} characters; at most {MAX_CHARACTERS:,} are read")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        where = f" at character {error.offset}" if isinstance(error, SyntaxError) and error.offset else ""
        raise UsageError(f"the condition {_short(text)} is malformed{where}; {GRAMMAR}") from None


def read_condition(text: str, words: Ontology, sort: Sort = "scene") -> Expression:
    """Read a condition as a class expression.

    Names are those of the run's ontology. About a scene, ``ball`` says that there is one, ``ball.x < 50`` that one lies
    there, and all that one ``and`` says of a name it says of one thing; ``ball.x < own.x``, ``touches(ball, own)`` and
    ``count(ball) >= 2`` speak of several. About a thing, ``x < 50`` speaks of itself. All else of the profile is
    written ``some(role, C)``, ``only(role, C)``, ``at_least(n, role, C)``, ``at_most(n, role, C)``,
    ``value(role, name)``, ``itself(role)``, ``true`` and ``false``.

    Raises
    ------
    UsageError
        When it is malformed, or uses words that the run does not have or in a wrong way.
    """
    return expression_of(tree_of(text), words, sort)


def expression_of(node: ast.expr, words: Ontology, sort: Sort = "scene") -> Expression:
    """Return the class expression of a part of a condition; see `read_condition`."""
    try:
        expression = _Reader(words, sort).read(node)
    except RecursionError:
        raise UsageError("the condition is nested too deeply") from None
    words.check(expression)
    return expression


class _Reader:
    def __init__(self, words: Ontology, sort: Sort) -> None:
        self.words = words
        self.sort = sort

    def read(self, node: ast.expr) -> Expression:
        """Return the expression of a node."""
        match node:
            case ast.BoolOp(op=ast.And(), values=values):
                return conjunction(*self._joined(values))
            case ast.BoolOp(values=values):
                return disjunction(*map(self.read, values))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Not(self.read(operand))
            case ast.Compare():
                return self._compared(node)
            case ast.Name(id=name):
                return self._named(name)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._called(name, arguments)
        raise UsageError(f"{_short(ast.unparse(node))} is no condition; {GRAMMAR}")

    def _joined(self, values: list[ast.expr]) -> list[Expression]:
        """Return the parts of an ``and``: all that is said of one name is said of one thing."""
        said: dict[object, list[Expression]] = {}
        for value in values:
            about = _subject(value) if self.sort == "scene" else None
            said.setdefault(about or value, []).append(self.read(value))
        return [_of_one_thing(parts) if isinstance(about, str) else parts[0] for about, parts in said.items()]

    def _named(self, name: str) -> Expression:
        if name in ("true", "false"):
            return Top() if name == "true" else Bottom()
        if self.sort == "thing" and name not in self.words.class_names and name in self.words.numbers:
            raise UsageError(f"'{name}' is a number: compare it, as in  {name} < 50")
        known(name, self.words.class_names, "class")
        if self.sort == "scene" and self.words.sort(name) == "thing":
            return Some(CONTAINS, Named(name))
        return Named(name)

    def _compared(self, node: ast.Compare) -> Expression:
        terms = [node.left, *node.comparators]
        parts = [self._pair(a, op, b) for a, op, b in zip(terms, node.ops, terms[1:], strict=False)]
        subject = _subject(node) if self.sort == "scene" else None
        return _of_one_thing(parts) if subject and len(parts) > 1 else conjunction(*parts)

    def _pair(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> Expression:
        if isinstance(op, ast.Eq) and _counted(left) is None:
            return _both(self._pair(left, ast.LtE(), right), self._pair(left, ast.GtE(), right))
        if isinstance(op, ast.Eq):
            return conjunction(self._pair(left, ast.GtE(), right), self._pair(left, ast.LtE(), right))
        if type(op) not in _COMPARISONS:
            raise UsageError(f"compare with <, <=, >, >= or ==, not as in  {ast.unparse(left)} … {ast.unparse(right)}")
        comparison = _COMPARISONS[type(op)]
        if _is_number(left):
            return self._pair_of(right, _TURNED[comparison], left)
        return self._pair_of(left, comparison, right)

    def _pair_of(self, term: ast.expr, comparison: Comparison, bound: ast.expr) -> Expression:
        if (counted := _counted(term)) is not None:
            return self._count(counted, comparison, bound)
        if not _is_number(bound):
            return self._ordered(term, comparison, bound)
        match term:
            case ast.Attribute(value=ast.Name(id=name), attr=number) if self.sort == "scene":
                known(number, self.words.numbers, "number")
                thing = self._named(name)
                if not isinstance(thing, Some):
                    raise UsageError(f"'{name}' is a class of scenes, which have no {number}")
                return Some(CONTAINS, conjunction(thing.filler, Facet(number, comparison, _number(bound))))
            case ast.Name(id=number) if self.sort == "thing":
                known(number, self.words.numbers, "number")
                return Facet(number, comparison, _number(bound))
        example = "own.y <= 33" if self.sort == "scene" else "y <= 33"
        raise UsageError(f"{_short(ast.unparse(term))} cannot be compared with a number; write it like  {example}")

    def _ordered(self, one: ast.expr, comparison: Comparison, other: ast.expr) -> Expression:
        """Return that one thing lies left of, right of, above or below another one."""
        match one, other:
            case ast.Attribute(value=ast.Name(id=a), attr=x), ast.Attribute(value=ast.Name(id=b), attr=y):
                role = ORDER.get((x, comparison))
                if x == y and role in self.words.role_names and self.sort == "scene":
                    assert role is not None
                    return self._related(role, a, b)
        raise UsageError(
            f"{_short(f'{ast.unparse(one)} {comparison} {ast.unparse(other)}')}: "
            "a number is compared with a literal, or x and y of two things by < and >"
        )

    def _related(self, role: str, one: str, other: str) -> Expression:
        subject, target = self._thing(one), self._thing(other)
        return Some(CONTAINS, conjunction(subject, target if role == CONTAINS else Some(role, target)))

    def _thing(self, name: str) -> Expression:
        return _Reader(self.words, "thing").read(ast.Name(id=name))

    def _count(self, counted: ast.expr, comparison: Comparison, bound: ast.expr) -> Expression:
        number = _number(bound)
        if number != int(number) or number < 0:
            raise UsageError(f"a count is compared with a whole number, not with {number:g}")
        filler, n = _Reader(self.words, "thing").read(counted), int(number)
        if comparison in ("<", "<="):
            most = n - (comparison == "<")
            return AtMost(most, CONTAINS, filler) if most >= 0 else Bottom()
        return AtLeast(n + (comparison == ">"), CONTAINS, filler)

    def _called(self, name: str, arguments: list[ast.expr]) -> Expression:
        inner = _Reader(self.words, "thing")
        match name, arguments:
            case (("some" | "only"), [ast.Name(id=role), filler]):
                return _QUANTIFIERS[name](role, inner.read(filler))
            case (("at_least" | "at_most"), [ast.Constant(value=int(number)), ast.Name(id=role), filler]) if (
                number >= 0
            ):
                return _NUMBERED[name](number, role, inner.read(filler))
            case "value", [ast.Name(id=role), ast.Name(id=individual)]:
                return HasValue(role, individual)
            case "itself", [ast.Name(id=role)]:
                return HasSelf(role)
            case role, [ast.Name(id=a), ast.Name(id=b)] if self.sort == "scene":
                known(role, self.words.role_names, "role")
                if b in self.words.individuals:
                    return Some(CONTAINS, conjunction(self._thing(a), HasValue(role, b)))
                return self._related(role, a, b)
        raise UsageError(f"{_short(f'{name}(…)')} with {len(arguments)} arguments is no condition; {GRAMMAR}")


def _subject(node: ast.expr) -> str | None:
    """Return the one name that a comparison of numbers with bounds is about."""
    if not isinstance(node, ast.Compare):
        return node.id if isinstance(node, ast.Name) and node.id not in ("true", "false") else None
    about = [term for term in (node.left, *node.comparators) if not _is_number(term)]
    match about:
        case [ast.Attribute(value=ast.Name(id=name))]:
            return name
    return None


def _of_one_thing(parts: list[Expression]) -> Expression:
    """Return ∃contains.(A ⊓ B ⊓ C) of ∃contains.(A ⊓ B) and ∃contains.(A ⊓ C)."""
    if not all(isinstance(part, Some) and part.role == CONTAINS for part in parts):
        return conjunction(*parts)
    return Some(CONTAINS, conjunction(*(part.filler for part in parts if isinstance(part, Some))))


def _both(one: Expression, other: Expression) -> Expression:
    return _of_one_thing([one, other])


def _counted(term: ast.expr) -> ast.expr | None:
    match term:
        case ast.Call(func=ast.Name(id="count"), args=[argument], keywords=[]):
            return argument
    return None


def _is_number(node: ast.expr) -> bool:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return _is_number(node.operand)
    return isinstance(node, ast.Constant)


def _number(node: ast.expr) -> float:
    """Return the value of a literal.

    Raises
    ------
    UsageError
        When it is no finite number.
    """
    sign = 1.0
    while isinstance(node, ast.UnaryOp):
        sign, node = -sign if isinstance(node.op, ast.USub) else sign, node.operand
    value = node.value if isinstance(node, ast.Constant) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
        raise UsageError(f"{_short(ast.unparse(node))} is no number; numbers are compared with numbers")
    return sign * value


def _short(text: str) -> str:
    text = " ".join(text.split())
    return repr(text if len(text) <= 60 else f"{text[:57]}…")
