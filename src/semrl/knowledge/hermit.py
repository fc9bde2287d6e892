"""HermiT (Glimm et al. 2014) as a second judge of edits, as owlready2 ships it: the extra ``dl``.

It finds what the tableau of `semrl.knowledge.consistency` does not look for: what follows from inverse and transitive
roles and from counting. Needs Java; without Java or the extra there is no such judge.
"""

import importlib.util
import os
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from semrl.core.errors import SemrlWarning, UsageError
from semrl.knowledge.consistency import asserted_axioms, fewer
from semrl.knowledge.ontology import Ontology, Role
from semrl.knowledge.owl import to_triples, write_owl
from semrl.knowledge.writing import write_condition

_BASE = "urn:semrl:checked#"
_JAVA = ("java", "-Xmx1000M", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1")
"""Compiled once and collected on one thread: what is asked is over before more of either pays."""
_LIMIT_S = 60.0
_HEAD = "Classes equivalent to"


def has_hermit() -> bool:
    """Tell whether HermiT can be asked: the extra ``dl`` and Java are here."""
    return importlib.util.find_spec("owlready2") is not None and shutil.which("java") is not None


def ask_hermit(
    options: Sequence[str], files: Sequence[Path], *, limit_s: float | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run HermiT's command line on ontologies.

    Parameters
    ----------
    options
        Of its command line, such as ``-k``: what is asked of each.
    files
        The ontologies.
    limit_s
        After which it is stopped; never when None.

    Raises
    ------
    subprocess.TimeoutExpired
        When it is stopped.
    """
    spec = importlib.util.find_spec("owlready2")
    assert spec is not None
    assert spec.origin is not None
    jars = Path(spec.origin).parent / "hermit"
    command = [*_JAVA, "-cp", f"{jars}{os.pathsep}{jars / 'HermiT.jar'}", "org.semanticweb.HermiT.cli.CommandLine"]
    command += [*options, *(file.as_uri() for file in files)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=limit_s)


def impossible_classes(ontologies: Sequence[Ontology]) -> list[frozenset[str]]:
    """Ask HermiT which classes of each ontology nothing can be of.

    Raises
    ------
    UsageError
        When it fails, or does not answer within a minute.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{number}.owl" for number in range(len(ontologies))]
        for file, words in zip(files, ontologies, strict=True):
            file.write_bytes(write_owl(to_triples(words, _BASE), _BASE, ".owl"))
        try:
            run = ask_hermit(["-U"], files, limit_s=_LIMIT_S)
            run.check_returncode()
        except (OSError, subprocess.SubprocessError) as error:
            raise UsageError(f"HermiT gave no answer ({type(error).__name__})") from None
    answers = run.stdout.split(_HEAD)[1:]
    if len(answers) != len(ontologies):
        raise UsageError("HermiT gave no answer that can be read")
    names = (frozenset(line.strip() for line in answer.splitlines()[1:]) for answer in answers)
    return [frozenset(name[1:] for name in found if name.startswith(":")) for found in names]


def require_possible_to_hermit(before: Ontology, after: Ontology, what: str) -> None:
    """Check with HermiT, where it is here, that an edit leaves no class without anything in it that could have some.

    Where it fails there is a warning, and what was found without it stands.

    Raises
    ------
    UsageError
        When a class is impossible now; the message has the axioms without which it would not be.
    """
    if not has_hermit():
        return
    try:
        was, now = impossible_classes([before, after])
        new = sorted(now - was)
        reason = _reason(after, new[0]) if new else ""
    except UsageError as error:
        warnings.warn(f"{error}; {what} was checked without it", SemrlWarning, stacklevel=4)
        return
    if new:
        raise UsageError(f"{what} is refused: nothing could be of the class {new[0]}, since {reason} (HermiT)")


def _reason(words: Ontology, name: str) -> str:
    """Return what a class is, and the axioms each of which its contradiction needs."""
    without = list(_without_each(words))
    found = impossible_classes([one for _, one in without]) if without else []
    needed = [text for (text, _), left in zip(without, found, strict=True) if name not in left]
    if name in words.definitions:
        one = words.definitions[name]
        needed.insert(0, f"it is {write_condition(one.expression, words, one.sort)}")
    return ", and ".join(needed) or "what is known of it contradicts itself in more than one way"


def _without_each(words: Ontology) -> Iterator[tuple[str, Ontology]]:
    """Yield each axiom, in words, and the ontology without it."""
    all_axioms = set(asserted_axioms(words))
    for fields in fewer(words):
        less = replace(words, **fields)
        left = set(asserted_axioms(less))
        if left < all_axioms:
            yield ", ".join(sorted(all_axioms - left)), less
    for place, role in enumerate(words.roles):
        for text, changed in _weaker(role):
            others = (*words.roles[:place], changed, *words.roles[place + 1 :])
            inverse = (Role(name=role.inverse),) if role.inverse and not changed.inverse else ()
            yield text, replace(words, roles=(*others, *inverse))


def _weaker(role: Role) -> Iterator[tuple[str, Role]]:
    if role.inverse:
        yield f"{role.name} is the inverse of {role.inverse}", replace(role, inverse="")
    if role.symmetric:
        yield f"{role.name} is symmetric", replace(role, symmetric=False)
    if role.transitive:
        yield f"{role.name} is transitive", replace(role, transitive=False)
    for chain in role.chains:
        left = tuple(one for one in role.chains if one != chain)
        yield f"{role.name} follows from {chain[0]} and {chain[1]}", replace(role, chains=left)
