"""Rules of concepts, read from the newest play, whatever the world model is made of."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby, islice

import numpy as np

from semrl.concepts import Concepts
from semrl.core import Trajectory
from semrl.core.arrays import Arrays
from semrl.core.errors import UsageError
from semrl.world_model.lifted.decision_lists import About, joined_lists, read_lists
from semrl.world_model.lifted.play import Play
from semrl.world_model.lifted.relations import counts_of, relations_of
from semrl.world_model.rules import Rule

NEWEST_DECISIONS = 20_000
"""Decisions that rules are read from."""

_RARE = 0.02
"""Share of the decisions in which a concept must have been seen, to have rules of its own."""

_FAMILIES = 4
"""Most families of things that move and that others are related to."""


class ConceptRules:
    """Remembers what was seen of things, and says what turns them, what brings rewards, and what actions do.

    They are decision lists of few literals (see `semrl.world_model.lifted.decision_lists`), for people to check:
    nothing is predicted by them. Where things are not followed there are none.

    Parameters
    ----------
    concepts
        What the things are; learned elsewhere.

    Attributes
    ----------
    play : Play
        What was seen, done and gained in the newest `NEWEST_DECISIONS`.
    """

    def __init__(self, concepts: Concepts) -> None:
        self.concepts = concepts
        self.play = Play(NEWEST_DECISIONS)
        self._lists: list[Rule] | None = None

    def partial_fit(self, trajectory: Trajectory) -> None:
        """Remember an episode."""
        if any(len(seen) for seen in trajectory.things):
            self.play.add(trajectory)
            self._lists = None

    def rules(self, actions: Sequence[str], *, most: int = 8) -> list[Rule]:
        """Return the rules, those about rewards first.

        Parameters
        ----------
        actions
            Names of the actions.
        most
            Rules for each velocity, and for the reward.

        Raises
        ------
        UsageError
            When less than one rule is asked for.
        """
        if most < 1:
            raise UsageError(f"at least one rule must be asked for, not {most}")
        found: list[Rule] = []
        for about, group in groupby(self._read(), key=lambda rule: rule.about):
            found += [_with_names(rule, about, actions) for rule in islice(group, most)]
        return found

    def to_arrays(self) -> Arrays:
        """Return what is remembered."""
        return self.play.to_arrays()

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.play.from_arrays(arrays)
        self._lists = None

    def _read(self) -> list[Rule]:
        if self._lists is None:
            self._lists = read_play(self.play, self.concepts) if self.concepts.is_fitted and len(self.play) else []
        return self._lists


def read_play(play: Play, concepts: Concepts) -> list[Rule]:
    """Read the rules of all concepts that move from some play; an action is written ``#number``."""
    table, alike = concepts.table_, concepts.families_
    objects = play.objects(concepts)
    kinds, numbers = relations_of(concepts, objects, _FAMILIES)
    families = [
        " or ".join(table.names[k] for k in np.flatnonzero((kinds.relation_of >= 0) & (alike == alike[number])))
        for number in numbers
    ]
    counts = counts_of(objects, len(concepts))
    n_actions = int(play.actions.max(initial=-1)) + 1
    lists = []
    common = np.flatnonzero(kinds.moving & (counts >= _RARE * len(play)))
    for number in sorted(common.tolist(), key=lambda c: -counts[c]):
        seen = play.rows(objects, number, kinds, discount=1.0)
        about = About(table.names[number], families, bool(kinds.controlled[number]))
        lists.append(read_lists(*seen, about, n_actions))
    return joined_lists(lists)


def _with_names(rule: Rule, about: str, actions: Sequence[str]) -> Rule:
    """Return a rule with the names of actions in place of their numbers."""
    said = tuple(
        f"{before}{actions[int(number)] if number and int(number) < len(actions) else number}"
        for before, _, number in (condition.partition("#") for condition in rule.conditions)
    )
    return replace(rule, about=about, conditions=said)
