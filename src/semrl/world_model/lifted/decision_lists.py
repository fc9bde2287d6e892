"""What was learned of concepts as rules that a person can check: few literals, how often they held, and an otherwise.

Trees predict; these explain. For each event of a concept, such as "vy turns", conditions of at most two literals over a
fixed vocabulary are chosen one after the other, each for what those before it left (a decision list, Rivest 1987).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from semrl.core import Floats
from semrl.world_model.lifted.events import (
    FEWEST,
    LATE,
    REWARD,
    Came,
    Event,
    came_as_reward,
    came_as_steered,
    rewards_by,
    turns_of,
    upsets_of,
)
from semrl.world_model.lifted.features import ACTION
from semrl.world_model.lifted.steering import effects_of, moves, steered_by
from semrl.world_model.lifted.vocabulary import About, Mask, Vocabulary
from semrl.world_model.rules import Rule

_MOST_ROWS = 20_000  # the newest, that rules are read from
_LEAST_WORTH, _LEAST_PRECISION = 0.15, 0.3
_TRIVIAL = 0.9  # share of the rows: what holds more often says nothing
_OTHERWISE = ("otherwise",)
_PRECISION = 0.7  # what recall counts against precision
_SECOND_LITERAL = 0.05  # by so much a condition of two must be worth more than one of one

Literals = dict[str, Mask]


@dataclass(frozen=True, kw_only=True, slots=True)
class DecisionList:
    """Rules about what may come, the first whose conditions hold counts, and what they say of other play."""

    about: str
    rules: tuple[Rule, ...]
    came: Came
    vocabulary: Vocabulary
    codes: tuple[float, ...] = ()
    """What each of the rules but an "otherwise" says that comes, as `came` has it; none: each says 1, of every row."""
    explained: float = 0.0
    """Of a list about the reward: how many it tells, each once, times the share of what it says that is right."""

    def says(self, rows: Floats) -> Floats:
        """Return what it says that comes of ``(n, f)`` rows, ``(n,)``."""
        if not self.codes:
            return np.ones(len(rows), np.float32)
        literals = self.vocabulary.literals(rows)
        said = np.zeros(len(rows), np.float32)
        for rule, code in reversed(list(zip(self.rules, self.codes, strict=False))):
            said[np.logical_and.reduce([literals[name] for name in rule.conditions])] = code
        return said

    def held(self, rows: Floats, targets: Floats) -> list[tuple[int, int]]:
        """Return of each rule in how many of ``(n, f)`` rows it was right, and in how many it was the first to hold.

        Counted as its support is; an "otherwise" has no conditions that could hold.
        """
        came = self.came(rows, targets)
        literals = self.vocabulary.literals(rows) if self.codes else _actions_in(rows, self.rules)
        left, counts = ~np.isnan(came), []
        for rule, code in zip(self.rules, self.codes or (1.0,) * len(self.rules), strict=False):
            holds = left & np.logical_and.reduce([literals[name] for name in rule.conditions])
            counts.append((int((np.sign(came[holds]) == np.sign(code)).sum()), int(holds.sum())))
            left &= ~holds
        return counts


def read_lists(rows: Floats, targets: Floats, about: About, n_actions: int) -> list[DecisionList]:
    """Read rules from what was seen of the things of one concept; an action is written ``#number``.

    Parameters
    ----------
    rows
        ``(n, f)``, see `semrl.world_model.lifted.features.describe`.
    targets
        ``(n, 10)``, see `semrl.world_model.lifted.play.TARGETS`.
    about
        The concept.
    n_actions
        Number of actions.
    """
    kept = moves(rows) | about.controlled
    rows, targets = rows[kept][-_MOST_ROWS:], targets[kept][-_MOST_ROWS:]
    moving = moves(rows)
    if moving.sum() < 2 * FEWEST:
        return []
    steered = steered_by(rows, targets, n_actions)
    vocabulary = Vocabulary(about, rows[moving])
    literals = {name: mask for name, mask in vocabulary.literals(rows).items() if mask[moving].mean() < _TRIVIAL}
    lists = _rewards(rows, targets, vocabulary, literals)
    if about.controlled and steered.steers(rows, targets):
        effects = tuple(effects_of(about.name, steered, rows, targets))
        did = came_as_steered(steered)
        lists += [
            DecisionList(about=rule.about, rules=effects, came=did, vocabulary=vocabulary) for rule in effects[:1]
        ]
        events = upsets_of(about.name, steered, rows, targets)
    else:
        events = turns_of(about.name, rows, targets)  # also of what only passes for controlled
    found = [_list(event, rows, targets, vocabulary, literals) for event in events]
    return lists + [one for one in found if one.rules]


def joined_lists(lists: Sequence[Sequence[DecisionList]]) -> list[DecisionList]:
    """Join the lists of several concepts; first, and of rewards alone, the one that explains them best."""

    best = max(range(len(lists)), key=lambda i: sum(one.explained for one in lists[i]), default=-1)
    rewards = [one for one in lists[best] if one.about == REWARD] if best >= 0 else []
    ordered = sorted(range(len(lists)), key=lambda i: i != best)
    return rewards + [one for i in ordered for one in lists[i] if one.about != REWARD]


def _actions_in(rows: Floats, effects: Sequence[Rule]) -> Literals:
    """Return where the actions were taken that rules about their effects speak of, each of one condition."""
    return {name: rows[:, ACTION] == int(name.partition("#")[2]) for (name,) in (rule.conditions for rule in effects)}


def _rewards(rows: Floats, targets: Floats, vocabulary: Vocabulary, literals: Literals) -> list[DecisionList]:
    """Say what brings gains, what losses, and how often there was neither otherwise."""
    name, came = vocabulary.about.name, came_as_reward(rows, targets)
    rules: list[Rule] = []
    codes: list[float] = []
    left = ~np.isnan(came)
    for event in rewards_by(name, came):
        chosen, left = _chosen(event, came, left, literals)
        rules, codes = rules + chosen, codes + [event.code] * len(chosen)
    if not rules:
        return []
    rules += _otherwise(Event(REWARD, f"none by {name}", 0.0, came_as_reward, 0, 0), came, left)
    found = DecisionList(
        about=REWARD, rules=tuple(rules), came=came_as_reward, vocabulary=vocabulary, codes=tuple(codes)
    )
    return [replace(found, explained=rewards_told(found.says(rows), came))]


def rewards_told(said: Floats, came: Floats) -> float:
    """Return how many rewards are told, each once, times the share of what is said that is right.

    What holds for long before a reward would count twice, when it is at hand and when it comes late.
    """
    speaks = (said != 0) & ~np.isnan(came)
    right = speaks & (np.sign(came) == np.sign(said))
    told = max(int((right & (np.abs(came) == size)).sum()) for size in (1, LATE))
    return told * int(right.sum()) / max(int(speaks.sum()), 1)


def _list(event: Event, rows: Floats, targets: Floats, vocabulary: Vocabulary, literals: Literals) -> DecisionList:
    """Choose conditions, and say what is left of the event otherwise."""
    came = event.came(rows, targets)
    rules, left = _chosen(event, came, ~np.isnan(came), literals)
    codes = (event.code,) * len(rules)
    rules += _otherwise(event, came, left) if rules else []
    return DecisionList(about=event.about, rules=tuple(rules), came=event.came, vocabulary=vocabulary, codes=codes)


def _chosen(event: Event, came: Floats, left: Mask, literals: Literals) -> tuple[list[Rule], Mask]:
    """Choose conditions one after the other, each for what those before it left; return what all of them leave."""
    rules: list[Rule] = []
    while len(rules) < event.most:
        open_for = [(_worth(came[left], event.code, mask[left]), said, mask) for said, mask in _conditions(literals)]
        worth, best, mask = max(
            open_for, key=lambda one: one[0] - _SECOND_LITERAL * (len(one[1]) - 1), default=(0.0, (), left)
        )
        if worth < _LEAST_WORTH:
            break
        covered = left & mask
        right = np.sign(came[covered]) == np.sign(event.code)
        rules.append(_rule(event, best, right))
        left = left & ~mask
    return rules, left


def _otherwise(event: Event, came: Floats, left: Mask) -> list[Rule]:
    """Say how often the event came where no condition held; what came late there was not missed yet."""
    rest = came[left & (np.abs(came) != LATE)]
    return [_rule(event, _OTHERWISE, rest == event.code)] if len(rest) else []


def _conditions(literals: Literals) -> list[tuple[tuple[str, ...], Mask]]:
    """Return every literal, and every two of them."""
    names = list(literals)
    single: list[tuple[tuple[str, ...], Mask]] = [((name,), literals[name]) for name in names]
    pairs = [((one, other), literals[one] & literals[other]) for i, one in enumerate(names) for other in names[i + 1 :]]
    return single + pairs


def _worth(came: Floats, code: float, covered: Mask) -> float:
    """Return how well a condition predicts an event, 0 … 1: a mean of precision and recall that favours precision."""
    wanted = np.sign(came) == np.sign(code)
    right, n = int((covered & wanted).sum()), int(covered.sum())
    if right < min(FEWEST, int(wanted.sum())) or right < _LEAST_PRECISION * n or not right:
        return 0.0
    missed = int((~covered & (came == code)).sum())  # what comes late is at hand once more
    precision, recall = right / n, right / (right + missed)
    weight = _PRECISION**2
    return float((1 + weight) * precision * recall / (weight * precision + recall))


def _rule(event: Event, said: tuple[str, ...], right: Mask) -> Rule:
    return Rule(
        about=event.about, conditions=said, value=event.value, decisions=len(right), error=0.0,
        claim=event.claim, right=int(right.sum()),
    )  # fmt: skip
