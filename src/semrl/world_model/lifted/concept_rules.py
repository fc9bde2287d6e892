"""Rules of concepts, read from the newest play, whatever the world model is made of."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby, islice

import numpy as np

from semrl.concepts import Concepts
from semrl.core import Ints, Trajectory
from semrl.core.arrays import Arrays
from semrl.core.errors import UsageError
from semrl.world_model.lifted.checking import Check, PredictedEpisode, check_list
from semrl.world_model.lifted.decision_lists import DecisionList, joined_lists, read_lists
from semrl.world_model.lifted.features import Kinds
from semrl.world_model.lifted.play import Play
from semrl.world_model.lifted.relations import counts_of, relations_of
from semrl.world_model.lifted.samples import samples_of
from semrl.world_model.lifted.vocabulary import About
from semrl.world_model.rules import Rule

NEWEST_DECISIONS = 20_000
"""Decisions that rules are read from."""

_RARE = 0.02
"""Share of the decisions in which a concept must have been seen, to have rules of its own."""

_FAMILIES, _FAMILIES_OF_STEERED = 4, 16
"""Most families of things that move and that others are related to, and that what actions move is: what befalls it may
come from each of many, as from the cars on a road."""


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
        self._lists: list[DecisionList] | None = None

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
        read = (rule for one in self._read() for rule in one.rules)
        for about, group in groupby(read, key=lambda rule: rule.about):
            found += [_with_names(rule, about, actions) for rule in islice(group, most)]
        return found

    def check(self, episodes: Sequence[PredictedEpisode]) -> list[Check]:
        """Compare every list with what came, and with what a world model predicted, in play that is new to it.

        Parameters
        ----------
        episodes
            With what was predicted at each decision.
        """
        play = _joined(one.trajectory for one in episodes)
        objects = play.objects(self.concepts)
        return [check_list(one, play, objects, episodes) for one in self._read()] if len(play) else []

    def held(self, actions: Sequence[str], trajectories: Sequence[Trajectory]) -> list[tuple[Rule, int, int]]:
        """Return how all rules but "otherwise" held in some play: each, how often it was right, and of how many times.

        Parameters
        ----------
        actions
            Names of the actions.
        trajectories
            The play.
        """
        play = _joined(trajectories)
        objects = play.objects(self.concepts)
        found = []
        for one in self._read() if len(play) else ():
            about = one.vocabulary.about
            rows, targets, *_ = samples_of(play, objects, about.concept, about.kinds)
            counts = one.held(rows, targets)
            found += [
                (_with_names(rule, one.about, actions), right, of)
                for rule, (right, of) in zip(one.rules, counts, strict=False)
            ]
        return found

    def to_arrays(self) -> Arrays:
        """Return what is remembered."""
        return self.play.to_arrays()

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.play.from_arrays(arrays)
        self._lists = None

    def _read(self) -> list[DecisionList]:
        if self._lists is None:
            self._lists = read_play(self.play, self.concepts) if self.concepts.is_fitted and len(self.play) else []
        return self._lists


def _joined(trajectories: Iterable[Trajectory]) -> Play:
    """Return episodes as play of their own."""
    episodes = list(trajectories)
    play = Play(sum(len(one.states) for one in episodes))
    for one in episodes:
        play.add(one)
    return play


def read_play(play: Play, concepts: Concepts) -> list[DecisionList]:
    """Read the rules of all concepts that move from some play; an action is written ``#number``."""
    objects = play.objects(concepts)
    counts = counts_of(objects, len(concepts))
    n_actions = int(play.actions.max(initial=-1)) + 1
    common = counts >= _RARE * len(play)
    lists = []
    for controlled, most in ((False, _FAMILIES), (True, _FAMILIES_OF_STEERED)):
        kinds, numbers = relations_of(concepts, objects, most)
        for number in np.flatnonzero(common & kinds.moving & (kinds.controlled == controlled)).tolist():
            rows, targets, *_ = samples_of(play, objects, number, kinds)
            about = _about(number, kinds, numbers, concepts)
            lists.append((counts[number], read_lists(rows, targets, about, n_actions)))
    return joined_lists([mine for _, mine in sorted(lists, key=lambda one: -one[0])])


def _about(number: int, kinds: Kinds, families: Ints, concepts: Concepts) -> About:
    """Name a concept and the families that it is related to."""
    names, alike = concepts.table_.names, concepts.families_
    members = [np.flatnonzero((kinds.relation_of >= 0) & (alike == alike[family])) for family in families]
    return About(
        concept=number,
        name=names[number],
        kinds=kinds,
        families=[" or ".join(names[k] for k in mine) for mine in members],
        autonomous=[bool((kinds.moving & ~kinds.controlled)[mine].all()) for mine in members],
    )


def _with_names(rule: Rule, about: str, actions: Sequence[str]) -> Rule:
    """Return a rule with the names of actions in place of their numbers."""
    said = tuple(
        f"{before}{actions[int(number)] if number and int(number) < len(actions) else number}"
        for before, _, number in (condition.partition("#") for condition in rule.conditions)
    )
    return replace(rule, about=about, conditions=said)
