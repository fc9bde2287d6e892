"""Manchester syntax of the profile: ``contains some (ball and x some xsd:double[< 50.0])``."""

import re
from collections.abc import Callable
from typing import NamedTuple

from semrl.core.errors import UsageError
from semrl.knowledge.condition import MAX_CHARACTERS
from semrl.knowledge.expressions import (
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
from semrl.knowledge.ontology import Ontology

_TOKEN = re.compile(
    r'\s*(?:(?P<literal>"(?:[^"\\]|\\.)*"(?:\^\^[\w:.<>/#-]+)?)|(?P<iri><[^<>\s]*>)|(?P<name>[A-Za-z_][\w.-]*(?::[\w.-]+)?|:[\w.-]+)'
    r"|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?f?)|(?P<sign><=|>=|[<>()\[\]{},]))"
)
_KEYWORDS = {"and", "or", "not", "some", "only", "min", "max", "exactly", "value", "Self", "that"}
_MOST_NESTED = 100


class _Token(NamedTuple):
    kind: str
    text: str
    place: int


def is_manchester(text: str) -> bool:
    """Tell whether a text looks like Manchester syntax rather than like a condition."""
    return bool(re.search(r"[\w>]\s+(some|only|min|max|exactly|value|Self)\b(?!\s*\()", text))


def read_manchester(text: str, words: Ontology) -> Expression:
    """Read a class expression in Manchester syntax.

    Names may carry a prefix, which is not looked up: nothing is ever fetched. Literals are xsd:double; a bare number in
    a facet is taken as one, as every number of a scene is.

    Raises
    ------
    UsageError
        When it is malformed, beyond the profile, or uses words that the run does not have.
    """
    expression = _Parser(_tokens(text), text).whole()
    words.check(expression)
    return expression


def _tokens(text: str) -> list[_Token]:
    if len(text) > MAX_CHARACTERS:
        raise UsageError(f"the class expression has {len(text):,} characters; at most {MAX_CHARACTERS:,} are read")
    found, place = [], 0
    text = text.rstrip()
    while place < len(text):
        match = _TOKEN.match(text, place)
        if not match:
            raise UsageError(
                f"the class expression is malformed at character {place + 1}: {text[place : place + 20]!r}"
            )
        kind = str(match.lastgroup)
        found.append(_Token(kind, match[kind], match.start(kind)))
        place = match.end()
    return found


class _Parser:
    def __init__(self, tokens: list[_Token], text: str) -> None:
        self.tokens = tokens
        self.text = text
        self.at = 0
        self.depth = 0

    def whole(self) -> Expression:
        """Return the expression that the text is."""
        expression = self._or()
        if self.at < len(self.tokens):
            raise self._wrong("'and', 'or' or the end")
        return expression

    def _or(self) -> Expression:
        self.depth += 1
        if self.depth > _MOST_NESTED:
            raise UsageError("the class expression is nested too deeply")
        parts = self._parts("or", self._and)
        self.depth -= 1
        return disjunction(*parts) if len(parts) > 1 else parts[0]

    def _and(self) -> Expression:
        parts = self._parts("and", self._primary)
        return conjunction(*parts) if len(parts) > 1 else parts[0]

    def _parts(self, joint: str, part: Callable[[], Expression]) -> list[Expression]:
        parts = [part()]
        while self._taken(joint):
            parts.append(part())
        return parts

    def _primary(self) -> Expression:
        if self._taken("not"):
            return Not(self._primary())
        if self._taken("("):
            inner = self._or()
            self._expect(")")
            return inner
        name = self._name("a class or a role")
        following = self._peek()
        if following in ("some", "only", "min", "max", "exactly", "value", "Self"):
            self.at += 1
            return self._restriction(name, following)
        if name in ("Thing", "Nothing"):
            return Top() if name == "Thing" else Bottom()
        return Named(name)

    def _restriction(self, role: str, word: str) -> Expression:
        if word == "Self":
            return HasSelf(role)
        if word == "value":
            return HasValue(role, self._name("an individual"))
        if word in ("some", "only"):
            if self._peek() in ("xsd:double", "double"):
                if word == "only":
                    raise UsageError(f"'{role} only xsd:double' is beyond the profile; say '{role} some xsd:double[…]'")
                return self._facets(role)
            return (Some if word == "some" else Only)(role, self._primary())
        number = self._count()
        filler = self._primary() if self._begins() else Top()
        if word == "exactly":
            return conjunction(AtLeast(number, role, filler), AtMost(number, role, filler))
        return (AtLeast if word == "min" else AtMost)(number, role, filler)

    def _facets(self, number: str) -> Expression:
        self.at += 1
        self._expect("[")
        facets = [self._facet(number)]
        while self._taken(","):
            facets.append(self._facet(number))
        self._expect("]")
        return conjunction(*facets)

    def _facet(self, number: str) -> Expression:
        token = self._next("a comparison")
        if token.text not in ("<", "<=", ">", ">="):
            self.at -= 1
            raise self._wrong("<, <=, > or >=")
        comparison: Comparison = token.text  # type: ignore[assignment]
        return Facet(number, comparison, self._double())

    def _double(self) -> float:
        token = self._next("a number")
        text = token.text
        if token.kind == "literal":
            text, _, kind = text[1:].rpartition('"')
            if kind not in ("^^xsd:double", "^^<http://www.w3.org/2001/XMLSchema#double>"):
                written = kind.removeprefix("^^") or "a string"
                raise UsageError(f'"{text}" is of the wrong type, {written}: numbers of a scene are xsd:double')
        elif token.kind != "number":
            self.at -= 1
            raise self._wrong("a number")
        try:
            value = float(text.removesuffix("f"))
        except ValueError:
            raise UsageError(f'"{text}" is no xsd:double') from None
        if not abs(value) < 1e300:
            raise UsageError(f'"{text}" is no finite number')
        return value

    def _count(self) -> int:
        token = self._next("a whole number")
        if not token.text.isdecimal() or len(token.text) > 6:
            self.at -= 1
            raise self._wrong("a whole number")
        return int(token.text)

    def _name(self, what: str) -> str:
        token = self._next(what)
        if token.kind not in ("name", "iri") or token.text in _KEYWORDS:
            self.at -= 1
            raise self._wrong(what)
        return re.split(r"[:#/]", token.text.strip("<>"))[-1]

    def _peek(self) -> str:
        return self.tokens[self.at].text if self.at < len(self.tokens) else ""

    def _begins(self) -> bool:
        """Whether a filler follows a number."""
        return self._peek() not in ("", ")", "and", "or", ",", "]")

    def _next(self, what: str) -> _Token:
        if self.at >= len(self.tokens):
            raise self._wrong(what)
        self.at += 1
        return self.tokens[self.at - 1]

    def _taken(self, text: str) -> bool:
        if self._peek() != text:
            return False
        self.at += 1
        return True

    def _expect(self, text: str) -> None:
        if not self._taken(text):
            raise self._wrong(f"'{text}'")

    def _wrong(self, expected: str) -> UsageError:
        if self.at >= len(self.tokens):
            return UsageError(f"the class expression ends where {expected} should stand")
        token = self.tokens[self.at]
        return UsageError(
            f"the class expression is malformed at character {token.place + 1}: {expected} should stand "
            f"where '{token.text}' does"
        )
