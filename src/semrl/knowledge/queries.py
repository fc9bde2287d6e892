"""Questions in SPARQL to the knowledge base of a map (§3.4.1): reading only, within bounds, and off any network."""

import json
import math
import re
import subprocess
import sys
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pyoxigraph as ox

from semrl.core.errors import SemrlError, UsageError
from semrl.core.strict_json import dumps
from semrl.knowledge.guard import guarded
from semrl.knowledge.vocabulary import INSTANCES, PREFIXES, prefixes

Value = str | int | float | bool | None
"""What a query finds; None where a variable has no value."""

_SANDBOX = Path(__file__).with_name("sandbox.py")
_XSD = PREFIXES["xsd"]
_INTEGERS = {_XSD + name for name in ("integer", "long", "int", "short", "byte", "nonNegativeInteger")}
_FLOATS = {_XSD + name for name in ("double", "float", "decimal")}


@dataclass(frozen=True, kw_only=True, slots=True)
class Limits:
    """What one query may cost. Whatever it is, the question is asked in a process that can be ended."""

    characters: int = 10_000
    """Longest query."""
    rows: int = 1_000
    """Most rows of an answer; the rest is cut off."""
    seconds: float = 30.0
    """Longest time, from beginning to end."""
    memory_mb: int = 2_048
    """Most memory of the process that answers (address space; not enforced by macOS and Windows)."""
    answer_characters: int = 10_000_000
    """Longest answer; the rest is cut off."""

    def __post_init__(self) -> None:
        for name in ("characters", "rows", "memory_mb", "answer_characters"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name} must be 1 or more, not {getattr(self, name)}")
        if not 0 < self.seconds <= 86_400:
            raise UsageError(f"seconds must be above 0 and a day at most, not {self.seconds}")


@dataclass(frozen=True, kw_only=True, slots=True)
class Answer:
    """What a query found."""

    variables: tuple[str, ...] = ()
    """Names of the columns of a SELECT."""
    rows: tuple[tuple[Value, ...], ...] = ()
    """Its rows. IRIs are written with the known prefixes, as in ``semrl:State``."""
    truncated: bool = False
    """Whether there were more rows than the limits allow."""
    truth: bool | None = None
    """Answer of an ASK; None for a SELECT."""


def ask(store: ox.Store, query: str, limits: Limits | None = None, *, base: str = INSTANCES) -> Answer:
    """Answer a SELECT or ASK query over a knowledge base; the prefixes of `vocabulary.prefixes` are known.

    Parameters
    ----------
    store
        What `to_store` made. It is not changed.
    query
        In SPARQL 1.1.
    limits
        What the query may cost.
    base
        What the names of instances begin with, as it was given to `to_store`; the prefix ``map`` stands for it.

    Raises
    ------
    UsageError
        When the query is malformed, asks for more than reading this store, or goes beyond the limits.
    SemrlError
        When no process can be started.
    """
    limits, known = limits or Limits(), prefixes(base)
    task = {
        "query": guarded(query, limits.characters),
        "prefixes": known,
        "rows": limits.rows,
        "seconds": limits.seconds,
        "memory_mb": limits.memory_mb,
        "answer_characters": limits.answer_characters,
    }
    triples = store.dump(format=ox.RdfFormat.N_TRIPLES, from_graph=ox.DefaultGraph())
    answer = json.loads(_run(dumps(task).encode() + b"\n" + (triples or b""), limits))
    if "error" in answer:
        raise UsageError(f"the query cannot be answered: {textwrap.shorten(answer['error'], 200, placeholder=' …')}")
    if "truth" in answer:
        return Answer(truth=answer["truth"])
    rows = tuple(tuple(_value(known, *cell) for cell in row) for row in answer["rows"])
    return Answer(variables=tuple(answer["variables"]), rows=rows, truncated=answer["truncated"])


def _run(task: bytes, limits: Limits) -> bytes:
    """Let the other process answer; end it when its time is over."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", str(_SANDBOX)], input=task, capture_output=True, timeout=limits.seconds, check=False
        )
    except subprocess.TimeoutExpired:
        raise UsageError(f"the query took longer than {limits.seconds:g} seconds; ask for less") from None
    except OSError as error:
        raise SemrlError(f"no process can be started to answer the query: {error.strerror or error}") from error
    if done.returncode < 0:
        most = f"{limits.memory_mb:,} MB and {limits.seconds:g} seconds"
        raise UsageError(f"the query is nested too deeply or needs more than {most}; ask for less")
    if done.returncode > 0:
        reason = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise SemrlError(f"the process that answers queries failed: {reason or done.returncode}")
    return done.stdout


def _value(known: Mapping[str, str], kind: str = "", text: str = "", datatype: str = "") -> Value:
    """Turn a term as the other process sends it into a plain value; nothing is an unbound variable."""
    if not kind:
        return None
    if kind == "iri":
        return _shortened(known, text)
    if datatype == _XSD + "boolean":
        return text in ("true", "1")
    try:
        if datatype in _INTEGERS:
            return int(text)
        number = float(text) if datatype in _FLOATS else math.nan
    except ValueError:  # RDF allows literals that are not what their datatype says
        return text
    return number if math.isfinite(number) else text  # JSON has no infinities


def _shortened(known: Mapping[str, str], iri: str) -> str:
    """Write an IRI with a prefix, where there is one and what follows is a plain name."""
    for prefix, namespace in known.items():
        local = iri.removeprefix(namespace)
        if local != iri and re.fullmatch(r"[\w%-]+", local):
            return f"{prefix}:{local}"
    return iri
