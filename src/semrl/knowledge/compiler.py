"""From an ontology to array predicates: which individuals of a scene are of which class, in microseconds."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.errors import DataError
from semrl.knowledge.expressions import (
    And,
    AtLeast,
    AtMost,
    Bottom,
    Expression,
    Facet,
    HasSelf,
    HasValue,
    Named,
    Not,
    Only,
    Or,
    Some,
    Top,
)
from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.kernels import (
    BELOW,
    BEYOND,
    BOTH,
    CHAIN,
    CLASS,
    COUNT,
    EITHER,
    EVERY,
    FROM,
    INVERSE,
    ITSELF,
    SCENE_ITSELF,
    SYMMETRIC,
    TRANSITIVE,
    UP_TO,
    VALUE,
    WITHOUT,
    axiom_rows,
    materialise,
    run_program,
)
from semrl.knowledge.ontology import SCENE, Ontology

_COMPARISONS = {"<": BELOW, "<=": UP_TO, ">": BEYOND, ">=": FROM}
_MANY = 2**31


class Classifier:
    """Decides classes of scenes: all that an ontology defines, and further expressions.

    Equal parts of expressions are decided once. Roles must have been closed under their axioms: see `entail`.

    Parameters
    ----------
    words
        The ontology.
    questions
        Name → expression, beside the classes that are defined.

    Attributes
    ----------
    names : tuple of str
        What is decided, in the order of the rows that `__call__` returns: atomic classes, defined ones, questions.

    Raises
    ------
    UsageError
        When an expression uses unknown words, or definitions are cyclic.
    """

    def __init__(self, words: Ontology, questions: Mapping[str, Expression] | None = None) -> None:
        self.words = words
        self._roles = {name: i for i, name in enumerate(words.role_names)}
        self._numbers = {name: i for i, name in enumerate(words.numbers)}
        self._concepts = {name: i for i, name in enumerate(words.concepts)}
        self._rows: list[tuple[int, int, int, int, int]] = []
        self._bounds: list[float] = []
        self._known: dict[tuple[int, int, int, int, int, float], int] = {}
        self._defined: dict[str, int] = {}
        questions = questions or {}
        for expression in questions.values():
            words.check(expression)
        wanted = {name: self._row(Named(name)) for name in words.concepts}
        for name in words.ordered():
            words.check(words.definitions[name].expression)
            self._defined[name] = self._row(words.definitions[name].expression)
        wanted |= self._defined | {name: self._row(expression) for name, expression in questions.items()}
        self.names = tuple(wanted)
        self._wanted: Ints = np.array(list(wanted.values()), np.int64)
        self._program: Ints = np.array(self._rows, np.int64).reshape(-1, 5)
        self._limits: NDArray[np.float64] = np.array(self._bounds)

    def __call__(self, scenes: Interpretation) -> NDArray[np.bool_]:
        """Return who is of which class, ``(b, len(names), n)``.

        Raises
        ------
        DataError
            When the scenes are not of this ontology.
        """
        shape = len(self.words.concepts), len(self._roles), len(self._numbers)
        if (scenes.classes.shape[1], scenes.roles.shape[1], scenes.numbers.shape[1]) != shape:
            raise DataError("the scenes are not written in the words of this ontology")
        return np.asarray(
            run_program(
                self._program,
                self._limits,
                scenes.present,
                scenes.classes,
                scenes.roles,
                scenes.numbers,
                self._wanted,
            )
        )

    def of_scenes(self, scenes: Interpretation, names: Sequence[str]) -> NDArray[np.bool_]:
        """Return of which of some classes each scene is, ``(b, len(names))``."""
        places = [self.names.index(name) for name in names]
        return self(scenes)[:, places, 0]

    def _write(self, op: int, a: int = 0, b: int = 0, low: int = 0, high: int = 0, *, bound: float = 0.0) -> int:
        row = op, a, b, low, high, bound
        if row not in self._known:
            self._known[row] = len(self._rows)
            self._rows.append(row[:5])
            self._bounds.append(bound)
        return self._known[row]

    def _row(self, expression: Expression) -> int:  # noqa: PLR0911, PLR0912 - one case a constructor
        """Return the row that says who is of an expression; write those that it needs."""
        match expression:
            case Named(name):
                if name == SCENE:
                    return self._write(SCENE_ITSELF)
                return self._defined[name] if name in self._defined else self._atomic(name)
            case Top():
                return self._write(EVERY)
            case Bottom():
                return self._write(WITHOUT, self._write(EVERY))
            case And(parts) | Or(parts):
                op, rows = BOTH if isinstance(expression, And) else EITHER, [self._row(part) for part in parts]
                row = rows[0]
                for other in rows[1:]:
                    row = self._write(op, row, other)
                return row
            case Not(part):
                return self._write(WITHOUT, self._row(part))
            case Facet(number, comparison, bound):
                return self._write(_COMPARISONS[comparison], self._numbers[number], bound=bound)
            case HasValue(role, individual):
                return self._write(VALUE, self._roles[role], self._place(individual))
            case HasSelf(role):
                return self._write(ITSELF, self._roles[role])
            case Some(role, filler):
                return self._write(COUNT, self._roles[role], self._row(filler), 1, _MANY)
            case Only(role, filler):
                return self._write(COUNT, self._roles[role], self._write(WITHOUT, self._row(filler)), 0, 0)
            case AtLeast(number, role, filler):
                return self._write(COUNT, self._roles[role], self._row(filler), number, _MANY)
            case AtMost(number, role, filler):
                return self._write(COUNT, self._roles[role], self._row(filler), 0, number)

    def _atomic(self, name: str) -> int:
        """Return the row that says who is of an atomic class, or of one that is below it."""
        row = self._write(CLASS, self._concepts[name])
        for other in self._concepts:
            if other != name and name in self.words.above(other):
                row = self._write(EITHER, row, self._write(CLASS, self._concepts[other]))
        return row

    def _place(self, individual: str) -> int:
        """Return where an individual stands in a scene: named ones stand first, behind the scene itself."""
        return 1 + tuple(self.words.individuals).index(individual)


def role_axioms(words: Ontology) -> Ints:
    """Return what is said of roles, as `entail` takes it."""
    place = {name: i for i, name in enumerate(words.role_names)}
    axioms: list[tuple[int, int, int, int]] = []
    for role in words.roles:
        own = place[role.name]
        axioms += [(INVERSE, own, place[role.inverse], 0)] if role.inverse else []
        axioms += [(SYMMETRIC, own, 0, 0)] if role.symmetric else []
        axioms += [(TRANSITIVE, own, 0, 0)] if role.transitive else []
        axioms += [(CHAIN, own, place[one], place[other]) for one, other in role.chains]
    return axiom_rows(axioms)


def entail(scenes: Interpretation, axioms: Ints) -> None:
    """Add to the roles of scenes, in place, what follows from axioms on roles."""
    if len(axioms):
        materialise(scenes.roles, axioms)
