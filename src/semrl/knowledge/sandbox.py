"""Answers one query, in a process of its own: run as a script by `semrl.knowledge.queries.ask`, which can end it.

The store cannot stop a query that computes for long before its first row, and a deeply nested one ends the process that
parses it. This process has bounds on memory and processor time, and once it has read the map it can open neither file
nor socket: whatever a query says, it reaches nothing. It imports nothing of this package, to begin quickly.

Standard input is a line of JSON (query, prefixes, limits), then the map as N-Triples; standard output the answer as
JSON.
"""

import contextlib
import json
import math
import sys
from typing import Any

import pyoxigraph as ox


def main() -> None:
    """Read the task, answer it."""
    task = json.loads(sys.stdin.buffer.readline())
    _bound("RLIMIT_CORE", 0)
    _bound("RLIMIT_CPU", math.ceil(2 * task["seconds"]))  # in case whoever asked is gone, else that one is first
    _bound("RLIMIT_AS", task["memory_mb"] << 20)
    store = ox.Store()
    store.bulk_load(sys.stdin.buffer.read(), format=ox.RdfFormat.N_TRIPLES)
    _bound("RLIMIT_NOFILE", 0)
    try:
        # Whatever dataset it names (FROM), it is the map that is asked.
        found = store.query(task["query"], prefixes=task["prefixes"], default_graph=ox.DefaultGraph(), named_graphs=[])
        answer = _answer(found, task["rows"], task["answer_characters"])
    except (SyntaxError, OSError, RuntimeError, ValueError) as error:
        answer = {"error": str(error)}
    sys.stdout.write(json.dumps(answer, allow_nan=False))


def _bound(resource_name: str, most: int) -> None:
    with contextlib.suppress(ImportError, ValueError, OSError):  # none on Windows; never above what we may have
        import resource

        resource.setrlimit(getattr(resource, resource_name), (most, most))


def _answer(found: object, rows: int, characters: int) -> dict[str, Any]:
    if isinstance(found, ox.QueryBoolean):
        return {"truth": bool(found)}
    if not isinstance(found, ox.QuerySolutions):
        raise ValueError("only SELECT and ASK are answered")
    kept: list[list[Any]] = []
    truncated = False
    for solution in found:
        row = [_plain(term) for term in solution]
        characters -= sum(len(text) for cell in row for text in cell)
        truncated = len(kept) == rows or characters < 0
        if truncated:
            break
        kept.append(row)
    return {"variables": [variable.value for variable in found.variables], "rows": kept, "truncated": truncated}


def _plain(term: object) -> tuple[str, ...]:
    """Tell a term as its kind, its value and its datatype."""
    if isinstance(term, ox.Literal):
        return ("literal", term.value, term.datatype.value)
    if isinstance(term, ox.NamedNode):
        return ("iri", term.value)
    return () if term is None else ("other", str(term))


if __name__ == "__main__":
    main()
