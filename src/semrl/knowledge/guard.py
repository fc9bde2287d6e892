"""What a query may not contain, found before the store sees it.

The parser of the store has no word boundaries: it reads ``SERVICEex:x`` and ``trueSERVICE<…>`` as SERVICE, and
``e:SERVICE`` as ``e:`` and SERVICE when ``e`` stands for ``http://host:80``, as a port ``80SERVICE`` makes no IRI. So
words are searched for what is refused, not compared with it. Where the same characters can be read in two ways, one of
which would hide a word, the query is refused with advice on how to write it.
"""

import re

from semrl.core.errors import UsageError

_ANYWHERE = ("SERVICE", "FROM")
_AT_THE_BEGINNING = (
    *("CONSTRUCT", "DESCRIBE", "LOAD", "INSERT", "DELETE", "CLEAR", "CREATE", "DROP"),
    *("COPY", "MOVE", "ADD", "WITH", "USING"),
)

_ESCAPE = re.compile(r"\\u([0-9A-Fa-f]{4})|\\U([0-9A-Fa-f]{8})")
_AUTHORITY_ONLY = re.compile(r"<(?:[\w+.-]+:)?//[^/?#>]*>")
# Each token is at most as long as the one that the store reads, so that nothing hides in it.
_TOKEN = re.compile(
    r'''
    (?P<space>\s+|\#[^\r\n]*)
  | (?P<string>"""(?:[^"\\]|\\.|"{1,2}(?!"))*+""" | \'\'\'(?:[^'\\]|\\.|'{1,2}(?!'))*+\'\'\'
      | "(?:[^"\\\r\n]|\\.)*+" | '(?:[^'\\\r\n]|\\.)*+')
  | (?P<iri><[^<>"{}|^`\\\x00-\x20]*>)
  | (?P<variable>[?$]\w+)
  | (?P<tag>@[A-Za-z]+(?:-[A-Za-z0-9]+)*)
  | (?P<prefix>(?:[^\W\d_][\w-]*)?):(?P<local>(?:[\w:%]|\\.)(?:[\w:%-]|\\.)*+)?
  | (?P<word>[^\W\d]\w*)
  | (?P<other>\\.|<<|.)
    ''',
    re.VERBOSE | re.DOTALL,
)
_CLOSING = {"(": ")", "[": "]", "{": "}"}


def guarded(query: str, characters: int) -> str:
    """Check that a query only reads; return it with its codepoint escapes (``\\u0053``) replaced, ready for the store.

    Raises
    ------
    UsageError
        When it is too long, contains SERVICE, FROM, LOAD, CONSTRUCT, DESCRIBE or another update, or cannot be read
        with certainty.
    """
    if len(query) > characters:
        raise UsageError(f"the query has {len(query):,} characters; at most {characters:,} are read")
    text = _unescaped(query)
    locals_too = _AUTHORITY_ONLY.search(text) is not None
    brackets: list[str] = []
    before = ""
    for token in _TOKEN.finditer(text):
        if token.lastgroup == "space":
            continue
        operator_fits = brackets[-1:] == ["("] and before not in set("(,=<>+-*/|&!^")
        _check_words(token, locals_too)
        _check_reading(token, operator_fits)
        _follow(brackets, token[0])
        before = token[0]
    return text


def _unescaped(query: str) -> str:
    """Replace codepoint escapes wherever they stand, as SPARQL 1.1 has it (§19.2 there), once."""
    try:
        text = _ESCAPE.sub(lambda match: chr(int(match[1] or match[2], 16)), query)
        text.encode()
    except (ValueError, OverflowError):  # beyond Unicode, or half of a surrogate pair
        raise UsageError("the query contains a character that does not exist") from None
    if re.search(r"\\[uU]", text):
        raise UsageError("the query contains a codepoint escape (\\u…) that is malformed or makes another one")
    return text


def _check_words(token: re.Match[str], locals_too: bool) -> None:
    if token["word"]:
        refused = _refused(token["word"])
    else:
        names = (token["prefix"] or "") + " " + ((token["local"] or "") if locals_too else "")
        refused = next((word for word in _ANYWHERE if word in names.upper()), None)
    if refused:
        raise UsageError(f"{refused} is not allowed: a query only reads this map, with SELECT or ASK")


def _refused(word: str) -> str | None:
    upper = word.upper()
    anywhere = (bad for bad in _ANYWHERE if bad in upper)
    return next(anywhere, None) or next((bad for bad in _AT_THE_BEGINNING if upper.startswith(bad)), None)


def _check_reading(token: re.Match[str], operator_fits: bool) -> None:
    """Refuse what might end a string, begin one or begin a comment in one reading and not in another."""
    if token[0] in ("'", '"'):
        raise UsageError("the query contains a quotation mark without its other half")
    if token[0] == "<<":
        raise UsageError("'<<' is not allowed: there are no triple terms in a map; write '< <' to compare with an IRI")
    iri = token["iri"] or ""
    if "'" in iri:
        raise UsageError(f"write ' as %27 in {iri}")
    if operator_fits and (set("#()[]") & set(iri) or any(word in iri.upper() for word in _ANYWHERE)):
        raise UsageError(f"{iri} may be an IRI or begin with 'less than'; write a prefixed name, or a space after <")


def _follow(brackets: list[str], token: str) -> None:
    """Keep the brackets that are open."""
    if token in _CLOSING:
        brackets.append(token)
    elif brackets and token == _CLOSING[brackets[-1]]:
        brackets.pop()
