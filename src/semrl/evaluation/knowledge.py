"""The knowledge of a run, listed, edited and exported."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from semrl.core.errors import UsageError
from semrl.core.files import locked
from semrl.evaluation.player import load_player
from semrl.evaluation.rules import keys_of_rules
from semrl.evaluation.words import words_of_run
from semrl.knowledge.edits import LOG, Edit, Edited, edited, read_log, standing, write_log
from semrl.knowledge.hermit import require_possible_to_hermit
from semrl.knowledge.ontology import Ontology, Role, known
from semrl.knowledge.writing import write_condition
from semrl.training.folder import RunFolder
from semrl.world_model.rules import Rule, sentence


@dataclass(frozen=True, kw_only=True)
class RunKnowledge:
    """What a run knows, and what people have added."""

    run: Path
    learned: Ontology
    edits: tuple[Edit, ...]
    now: Edited
    base: str
    """What all names begin with, as IRIs."""
    decisions: int
    """Of the training that it was learned in."""
    rules: Mapping[str, Rule]
    """By which it predicts, and which can be switched off: name → rule."""

    def to_dict(self) -> dict[str, Any]:
        """Return it as ``--json`` prints it."""
        words = self.now.words
        return {
            "run": str(self.run),
            "concepts": [
                {
                    "name": name,
                    "comment": comment,
                    "above": list(words.above(name)[1:]),
                    "numbers": _ranges(words, name),
                }
                for name, comment in words.concepts.items()
            ],
            "roles": [
                {"name": role.name, "comment": role.comment, "characteristics": characteristics(role)}
                for role in words.roles
            ],
            "classes": [
                {
                    "name": name,
                    "condition": write_condition(one.expression, words, one.sort),
                    "of": one.sort,
                    "origin": one.origin,
                    "support": one.support,
                    "error": one.error,
                    "forbidden": name in self.now.forbidden,
                    "enabled": name not in self.now.disabled,
                }
                for name, one in words.definitions.items()
            ],
            "rules": [
                {"name": name, "about": rule.about, "says": sentence(rule), "enabled": name not in self.now.disabled}
                for name, rule in self.rules.items()
            ],
            "edits": len(standing(self.edits)),
        }


def load_knowledge(run: str | Path) -> RunKnowledge:
    """Read what a run knows.

    Raises
    ------
    UsageError
        When there is no such run, it cannot predict, or its edits do not go with what it has learned.
    """
    player = load_player(run, memory=True)
    learned, edits = words_of_run(player, run).words, read_log(Path(run))
    return RunKnowledge(
        run=Path(run),
        learned=learned,
        edits=tuple(edits),
        now=edited(learned, edits),
        base=RunFolder.open(Path(run)).base_iri,
        decisions=player.decisions,
        rules=keys_of_rules(player),
    )


def edit_knowledge(run: str | Path, edit: Edit) -> RunKnowledge:
    """Add an edit to the log of a run, when what is known then is consistent; return what is known.

    HermiT is asked as well, where the extra ``dl`` and Java are here.

    Raises
    ------
    UsageError
        When the edit is refused, with the reason, or another process edits the run; the log is as it was.
    """
    before = load_knowledge(run)
    if edit.do in ("add", "assert"):
        after = edited(before.learned, (*before.edits, edit)).words
        require_possible_to_hermit(before.now.words, after, f"'{edit.name}'")
    edits, now = log_edit(run, before.learned, edit, before.rules)
    return replace(before, edits=edits, now=now)


def log_edit(
    run: str | Path, learned: Ontology, edit: Edit, rules: Collection[str] = ()
) -> tuple[tuple[Edit, ...], Edited]:
    """Add an edit to the log of a run that has learned these words and rules; return all edits and what is known now.

    Raises
    ------
    UsageError
        See `edit_knowledge`.
    """
    path = Path(run)
    with locked(path / f"{LOG}.lock", f"the knowledge of {run} is being edited by another process"):
        edits = (*read_log(path), edit)
        if edit.do == "undo" and not standing(edits[:-1]):
            raise UsageError(f"there is no edit of {run} to take back")
        if edit.do in ("disable", "enable"):
            known(edit.name, (*edited(learned, edits[:-1]).words.definitions, *rules), "defined class or rule")
        now = edited(learned, edits)
        write_log(path, edits)
    return edits, now


def characteristics(role: Role) -> list[str]:
    """Return what is said of a role, in OWL's words."""
    return [
        *(["symmetric"] if role.symmetric else []),
        *(["transitive"] if role.transitive else []),
        *([f"inverse of {role.inverse}"] if role.inverse else []),
        *(f"follows from {one} and {other}" for one, other in role.chains),
    ]


def _ranges(words: Ontology, name: str) -> dict[str, Sequence[float]]:
    return {number: list(bounds) for (concept, number), bounds in words.ranges.items() if concept == name}
