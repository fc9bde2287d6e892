"""What a query may not contain, found before the store sees it.

The store parses queries, not updates, so that nothing but SERVICE could reach beyond it. Its parser has no word
boundaries (``trueSERVICE<…>`` is SERVICE), so that the word is refused wherever it stands, in a text or a name too.
"""

import re

from semrl.core.errors import UsageError

_ESCAPE = re.compile(r"\\u([0-9A-Fa-f]{4})|\\U([0-9A-Fa-f]{8})")


def guarded(query: str, characters: int) -> str:
    """Check that a query only reads; return it with its codepoint escapes (``\\u0053``) replaced, ready for the store.

    Raises
    ------
    UsageError
        When it is too long, contains SERVICE, or cannot be read with certainty.
    """
    if len(query) > characters:
        raise UsageError(f"the query has {len(query):,} characters; at most {characters:,} are read")
    try:  # wherever escapes stand, as SPARQL 1.1 has it (§19.2 there), once
        text = _ESCAPE.sub(lambda match: chr(int(match[1] or match[2], 16)), query)
        text.encode()
    except (ValueError, OverflowError):  # beyond Unicode, or half of a surrogate pair
        raise UsageError("the query contains a character that does not exist") from None
    if re.search(r"\\[uU]", text):
        raise UsageError("the query contains a codepoint escape (\\u…) that is malformed or makes another one")
    if "SERVICE" in text.upper():
        raise UsageError("SERVICE is not allowed, not even in a name or a text: a query only reads this map")
    return text
