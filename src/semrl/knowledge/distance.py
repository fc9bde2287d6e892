"""How far scenes are from being of a class: 0 where they are, else about how much must change for it."""

import numpy as np
from numpy.typing import NDArray

from semrl.knowledge.compiler import Classifier
from semrl.knowledge.expressions import (
    And,
    AtLeast,
    AtMost,
    Bottom,
    Expression,
    Facet,
    Not,
    Only,
    Or,
    Some,
    Top,
    negation_normal,
)
from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.ontology import Ontology

OTHERWISE = 100.0
"""What it counts to be of another class, or in another role: as much as crossing the image."""

_LEAST = 1e-3
"""What a bound counts that is just missed."""


class Distance:
    """The distance of scenes to a class expression: sums over ⊓, the least over ⊔ and over those that ∃ looks at.

    It is 0 exactly where the expression holds, so it serves a search as a heuristic; it is no metric.

    Parameters
    ----------
    expression
        What is sought.
    words
        The ontology that its words are of.
    """

    def __init__(self, expression: Expression, words: Ontology) -> None:
        self.words = words
        self.expression = negation_normal(words.unfolded(expression))
        self._atoms = {part: f"_{i}" for i, part in enumerate(dict.fromkeys(_leaves(self.expression)))}
        self._classifier = Classifier(words, {name: part for part, name in self._atoms.items()})
        self._places = {part: self._classifier.names.index(name) for part, name in self._atoms.items()}

    def __call__(self, scenes: Interpretation) -> NDArray[np.float64]:
        """Return the distance of each scene, ``(b,)``; inf where no change of it would do."""
        held = self._classifier(scenes)
        return np.asarray(self._of(self.expression, scenes, held)[:, 0])

    def _of(  # noqa: PLR0911 - one case a constructor
        self, expression: Expression, scenes: Interpretation, held: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return the distance of each individual, ``(b, n)``."""
        match expression:
            case And(parts):
                return np.asarray(sum(self._of(part, scenes, held) for part in parts))
            case Or(parts):
                return np.asarray(np.min([self._of(part, scenes, held) for part in parts], axis=0))
            case Facet(number, comparison, bound):
                return self._gap(self._value(number, scenes), comparison, bound)
            case Not(Facet(number, comparison, bound)):
                value = self._value(number, scenes)
                gap = self._gap(value, {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}[comparison], bound)
                return np.where(np.isnan(value), 0.0, gap)
            case Some(role, filler):
                return self._nearest(1, role, filler, scenes, held)
            case AtLeast(number, role, filler):
                return self._nearest(number, role, filler, scenes, held)
            case Only(role, filler):
                return self._most(0, role, Not(filler), scenes, held)
            case AtMost(number, role, filler):
                return self._most(number, role, filler, scenes, held)
            case Top() | Bottom():
                return np.full(scenes.present.shape, 0.0 if isinstance(expression, Top) else np.inf)
        return np.where(held[:, self._places[expression]], 0.0, OTHERWISE)

    def _value(self, number: str, scenes: Interpretation) -> NDArray[np.float64]:
        return np.asarray(scenes.numbers[:, list(self.words.numbers).index(number)])

    @staticmethod
    def _gap(value: NDArray[np.float64], comparison: str, bound: float) -> NDArray[np.float64]:
        over = value - bound if comparison in ("<", "<=") else bound - value
        missed = over >= 0 if comparison in ("<", ">") else over > 0
        return np.where(np.isnan(value), OTHERWISE, np.where(missed, np.maximum(over, 0) + _LEAST, 0.0))

    def _related(self, role: str, scenes: Interpretation) -> NDArray[np.float64]:
        """Return what it counts to put each pair in a role, ``(b, n, n)``; inf for those who are not there."""
        there = scenes.roles[:, self.words.role_names.index(role)]
        counted = np.where(there, 0.0, OTHERWISE)
        return np.where(scenes.present[:, None, :], counted, np.inf)

    def _nearest(
        self, number: int, role: str, filler: Expression, scenes: Interpretation, held: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        if number == 0:
            return np.zeros(scenes.present.shape)
        each = self._related(role, scenes) + self._of(filler, scenes, held)[:, None, :]
        each = np.minimum(each, 10 * OTHERWISE)  # something may appear
        if number > each.shape[2]:
            return np.full(scenes.present.shape, np.inf)
        return np.asarray(np.sort(each, axis=2)[:, :, :number].sum(axis=2))

    def _most(
        self, number: int, role: str, filler: Expression, scenes: Interpretation, held: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return what it counts to let all but so many leave the role or the class."""
        there = scenes.roles[:, self.words.role_names.index(role)] & scenes.present[:, None, :]
        leaves = self._of(negation_normal(filler, negated=True), scenes, held)[:, None, :]
        cost = np.where(there & (leaves > 0), np.minimum(leaves, OTHERWISE), 0.0)
        n = cost.shape[2]
        return np.asarray(np.sort(cost, axis=2)[:, :, : max(n - number, 0)].sum(axis=2))


def _leaves(expression: Expression) -> list[Expression]:
    """Return the parts that are decided, not measured."""
    match expression:
        case And(parts) | Or(parts):
            return [leaf for part in parts for leaf in _leaves(part)]
        case Some(_, filler) | Only(_, filler) | AtLeast(_, _, filler) | AtMost(_, _, filler):
            inner = negation_normal(filler, negated=True) if isinstance(expression, Only | AtMost) else filler
            return [*_leaves(filler), *_leaves(inner)]
        case Facet() | Not(Facet()) | Top() | Bottom():
            return []
    return [expression]
