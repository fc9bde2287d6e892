"""What people add to the knowledge of a run: a log of edits beside it, each checked before it is taken."""

import ast
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Literal

from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.knowledge.condition import read_condition, tree_of
from semrl.knowledge.consistency import contradiction
from semrl.knowledge.expressions import Expression, Named
from semrl.knowledge.manchester import is_manchester, read_manchester
from semrl.knowledge.ontology import Definition, Ontology, Sort, known
from semrl.knowledge.writing import write_condition

LOG = "knowledge.jsonl"
"""File in a run's folder; a line an edit, never changed once written."""

_MOST_EDITS = 10_000

Kind = Literal["add", "disable", "enable", "assert", "undo"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Edit:
    """One line of the log."""

    do: Kind
    name: str = ""
    """Of a class; of an assertion, the axiom."""
    text: str = ""
    """What a class is defined as."""
    sort: Sort = "scene"
    forbidden: bool = False
    """Whether plans must keep out of the class."""
    comment: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Edited:
    """The knowledge of a run as people have made it."""

    words: Ontology
    forbidden: tuple[str, ...] = ()
    """Classes of scenes that plans keep out of."""
    disabled: tuple[str, ...] = ()
    """Classes that are defined, and count for nothing now."""


def read_log(run: Path) -> list[Edit]:
    """Read the edits of a run, oldest first.

    Raises
    ------
    SemrlError
        When the log is damaged; the message names the line.
    """
    try:
        lines = (run / LOG).read_bytes().splitlines()
    except FileNotFoundError:
        return []
    edits = []
    for number, line in enumerate(lines, 1):
        try:
            edits.append(_read(line))
        except (ValueError, TypeError):
            raise SemrlError(f"{run / LOG} is damaged in line {number}; remove that line to go on without it") from None
    return edits


def _read(line: bytes) -> Edit:
    """Read a line of the log; a ValueError or TypeError if it is none."""
    edit = Edit(**json.loads(line.decode()))
    for field in fields(Edit):
        if not isinstance(getattr(edit, field.name), bool if field.name == "forbidden" else str):
            raise TypeError(f"{field.name} is of another type")
    return edit


def write_log(run: Path, edits: Sequence[Edit]) -> None:
    """Write the edits of a run, whole or not at all."""
    if len(edits) > _MOST_EDITS:
        raise UsageError(f"{run / LOG} has {len(edits):,} edits; at most {_MOST_EDITS:,} are kept")
    write_text(run / LOG, "".join(dumps(asdict(edit)) + "\n" for edit in edits))


def standing(edits: Sequence[Edit]) -> list[Edit]:
    """Return the edits that no ``undo`` took back."""
    left: list[Edit] = []
    for edit in edits:
        if edit.do != "undo":
            left.append(edit)
        elif left:
            left.pop()
    return left


def edited(words: Ontology, edits: Sequence[Edit]) -> Edited:
    """Return what a run knows after some edits. Classes that are switched need not be there (any more).

    Raises
    ------
    UsageError
        When an edit does not go with what is known, or makes something unsatisfiable; the message says why.
    """
    now = Edited(words=words)
    for edit in standing(edits):
        now = applied(now, edit)
    return now


def applied(before: Edited, edit: Edit) -> Edited:
    """Return what is known after one more edit; see `edited`."""
    match edit.do:
        case "add":
            after = _added(before, edit)
        case "assert":
            after = replace(before, words=_asserted(before.words, edit.name))
        case "disable" | "enable":
            # a class that play taught may be gone since, or not be there yet at a milestone
            others = tuple(name for name in before.disabled if name != edit.name)
            return replace(before, disabled=(*others, edit.name) if edit.do == "disable" else others)
        case _:
            return before
    _require_coherent(after.words, f"'{edit.name}'")
    return after


def enabled_forbidden(now: Edited) -> tuple[str, ...]:
    """Return the forbidden classes that count."""
    return tuple(name for name in now.forbidden if name not in now.disabled)


def _added(before: Edited, edit: Edit) -> Edited:
    if not edit.name.isidentifier():
        raise UsageError(f"'{edit.name}' cannot be the name of a class: it is made of letters, digits and _")
    if edit.forbidden and edit.sort == "thing":
        raise UsageError("only classes of scenes can be forbidden; say some(contains, …) of the thing")
    definition = Definition(
        expression=read_class(edit.text, before.words, edit.sort), sort=edit.sort, comment=edit.comment
    )
    forbidden = tuple(name for name in before.forbidden if name != edit.name)
    return replace(
        before,
        words=before.words.having(**{edit.name: definition}),
        forbidden=(*forbidden, edit.name) if edit.forbidden else forbidden,
    )


def read_class(text: str, words: Ontology, sort: Sort) -> Expression:
    """Read what a class is defined as, in either syntax."""
    return read_manchester(text, words) if is_manchester(text) else read_condition(text, words, sort)


def _asserted(words: Ontology, text: str) -> Ontology:
    """Return the words with one more axiom: ``disjoint(A, B)`` or ``below(A, B)`` of atomic classes."""
    match tree_of(text):
        case ast.Call(func=ast.Name(id=("disjoint" | "below") as what), args=[ast.Name(id=a), ast.Name(id=b)]):
            for name in (a, b):
                known(name, words.concepts, "atomic class")
            if what == "disjoint":
                return replace(words, disjoint=(*words.disjoint, (a, b)))
            if a in words.above(b):
                raise UsageError(f"{a} is above {b}, so it cannot be below it")
            return replace(words, parents=(*words.parents, (a, b)))
    raise UsageError("assert disjoint(A, B) or below(A, B) of two classes")


def _require_coherent(words: Ontology, what: str) -> None:
    """Check that every class may have something in it.

    Raises
    ------
    UsageError
        When one may not; the message has the reason.
    """
    for problem in incoherences(words):
        raise UsageError(f"{what} is refused: {problem}")


def incoherences(words: Ontology) -> Iterator[str]:
    """Yield of each class that nothing can be of, why."""
    for name in (*words.concepts, *words.definitions):
        if found := contradiction(Named(name), words, words.sort(name)):
            definition = words.definitions.get(name)
            axioms = list(found.axioms)
            if definition:
                inner = contradiction(definition.expression, words, definition.sort)
                least = definition.expression if inner is None else inner.expression
                axioms.insert(0, f"it is {write_condition(least, words, definition.sort)}")
            yield f"nothing could be of the class {name}, since {', and '.join(axioms)}"
