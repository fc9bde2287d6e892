"""``semrl knowledge``: what a run knows, listed, edited and exported."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console
from semrl.core.errors import UsageError
from semrl.core.files import require_writable, write_atomic, write_text
from semrl.core.strict_json import dumps
from semrl.evaluation.knowledge import RunKnowledge, edit_knowledge, load_knowledge
from semrl.knowledge.edits import Edit, incoherences
from semrl.knowledge.omn import write_omn
from semrl.knowledge.owl import to_triples, write_owl

Action = Literal["list", "add", "disable", "enable", "assert", "undo", "check"]
_SUFFIXES = (".ttl", ".owl", ".omn")
_WORDS = {"add": 2, "disable": 1, "enable": 1, "assert": 1}
"""Action → how many words must follow it."""


@dataclass(frozen=True, kw_only=True)
class KnowledgeArguments:
    """List concepts, roles and classes of a run; add, disable, enable, assert what people know better, undo, check.

    Edits are kept in a log beside the run; the next decision obeys, nothing is retrained. What would make a class
    impossible is refused with the reason.

    For example
      semrl knowledge runs/first
      semrl knowledge runs/first add Low 'own.y > 66'
      semrl knowledge runs/first add High 'own.y < 25' --forbid
      semrl knowledge runs/first assert 'disjoint(ball, other)'
      semrl knowledge runs/first disable r1c0ffee
      semrl knowledge runs/first undo
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    action: tyro.conf.Positional[Action] = "list"
    """What to do."""
    words: tyro.conf.Positional[tuple[str, ...]] = ()
    """add: a name and a condition or a class expression; disable, enable: the name of a class, or of a rule as `semrl
    rules --trees` prints it, without --most; assert: an axiom."""
    forbid: bool = False
    """With add: plans keep out of the class."""
    of_things: bool = False
    """With add: the class is one of things, not of scenes."""
    comment: str = ""
    """With add: what the class is, in words."""
    export: Path | None = None
    """Also write the ontology in OWL: .ttl, .owl, or .omn, which is Manchester syntax."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, edit, print."""
    arguments = parse(KnowledgeArguments, argv, command="knowledge")
    _check(arguments)
    edit = _edit(arguments)
    known = edit_knowledge(arguments.run, edit) if edit else load_knowledge(arguments.run)
    problems = list(incoherences(known.now.words)) if arguments.action == "check" else []
    if arguments.export:
        _export(known, arguments.export)
    if arguments.json:
        checked = {"problems": problems} if arguments.action == "check" else {}
        print(dumps({**known.to_dict(), **checked}))
    elif arguments.action == "list":
        _list(known)
    elif arguments.action == "check":
        console.print("\n".join(problems) or "consistent: every class may have something in it", markup=False)
    else:
        console.print("done", markup=False)


def _check(arguments: KnowledgeArguments) -> None:
    wanted = _WORDS.get(arguments.action, 0)
    if len(arguments.words) != wanted:
        raise UsageError(f"'{arguments.action}' takes {wanted} words after it, not {len(arguments.words)}")
    if arguments.export:
        if arguments.export.suffix.lower() not in _SUFFIXES:
            raise UsageError(f"an ontology is exported as {', '.join(_SUFFIXES)}, not as {arguments.export.name}")
        require_writable(arguments.export)


def _edit(arguments: KnowledgeArguments) -> Edit | None:
    match arguments.action, arguments.words:
        case "add", (name, text):
            sort: Literal["thing", "scene"] = "thing" if arguments.of_things else "scene"
            return Edit(
                do="add", name=name, text=text, sort=sort, forbidden=arguments.forbid, comment=arguments.comment
            )
        case ("disable" | "enable" | "assert") as do, (name,):
            return Edit(do=do, name=name)
        case "undo", _:
            return Edit(do="undo")
    return None


def _export(known: RunKnowledge, path: Path) -> None:
    provenance = {"wasDerivedFrom": str(known.run), "value": f"{known.decisions} decisions of training"}
    about = f"What {known.run.name} knows"
    if path.suffix.lower() == ".omn":
        write_text(path, write_omn(known.now.words, known.base, about=about, provenance=provenance))
        return
    triples = to_triples(known.now.words, known.base, about=about, provenance=provenance)
    written = write_owl(triples, known.base, path.suffix.lower())
    write_atomic(path, lambda file: file.write(written))


def _list(known: RunKnowledge) -> None:
    entries = known.to_dict()
    lines = ["concepts"]
    for one in entries["concepts"]:
        above = f", below {', '.join(one['above'])}" if one["above"] else ""
        ranges = "".join(f"; {number} {low:.0f} … {high:.0f}" for number, (low, high) in one["numbers"].items())
        lines.append(f"  {one['name']}{above}: {one['comment']}{ranges}")
    lines.append("roles")
    lines += [
        f"  {one['name']}: {one['comment']} {', '.join(one['characteristics'])}".rstrip() for one in entries["roles"]
    ]
    lines.append("classes" if entries["classes"] else "no classes are defined yet")
    for one in entries["classes"]:
        marks = [*(["forbidden"] if one["forbidden"] else []), *([] if one["enabled"] else ["disabled"])]
        play = f"  ({one['support']:,} decisions, error {one['error']:.1%})" if one["support"] else ""
        lines.append(f"  {one['name']} ({', '.join([one['origin'], *marks])}): {one['condition']}{play}")
    if off := [one for one in entries["rules"] if not one["enabled"]]:
        lines += ["rules that are switched off", *(f"  {one['name']}  {one['about']}: {one['says']}" for one in off)]
    console.print("\n".join(lines), soft_wrap=True, markup=False, highlight=False)
