"""The rules by which a run predicts, for those who want to check them."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from semrl.core.errors import UsageError
from semrl.evaluation.player import Player, load_player
from semrl.world_model.lifted.checking import Check
from semrl.world_model.protocol import RuleBased, RulesThatFire
from semrl.world_model.rules import Rule, RuleBook, sentence

MOST = 8
"""Rules for each number of a state, and for the reward, when nothing else is asked for."""


def load_rules(run: str | Path, *, most: int = MOST, trees: bool = False) -> list[Rule]:
    """Read the rules that a run has learned, so many for each number and for the reward.

    Parameters
    ----------
    run
        Its folder.
    most
        Rules for each number.
    trees
        Those by which it predicts, of its trees, in place of the short ones about concepts.

    Raises
    ------
    UsageError
        When there is no such run, it has no map, or no rules of this sort.
    """
    player = load_player(run)
    world_model = player.require_predictions(run).world_model
    found = tree_rules_of(player, most=most) if trees else rules_of(player, most=most)
    if not found and (trees or not isinstance(world_model, RuleBased)):
        raise UsageError(
            f"{run} predicts by '{player.config.planning.world_model}', which has no rules to read; "
            "ask a run that was trained with --planning.world-model trees"
        )
    return found


def rules_of(player: Player, *, most: int = MOST) -> list[Rule]:
    """Return the rules for people: about concepts where things are followed, else those of the trees."""
    if player.planning is None:
        return []
    return player.planning.concept_rules.rules(player.action_names, most=most) or tree_rules_of(player, most=most)


def tree_rules_of(player: Player, *, most: int = MOST) -> list[Rule]:
    """Return the rules by which a player with a map predicts; none where it has no trees, or has learned nothing."""
    world = player.planning.world_model if player.planning else None
    if not (world and world.is_fitted and isinstance(world, RuleBased)):
        return []
    return world.rules(player.encoder.space.fact_names, player.action_names, most=most, unit=unit_of(player))


@dataclass(frozen=True, kw_only=True, slots=True)
class Learned:
    """What was learned of a concept, or of the reward, in sentences."""

    name: str
    moved: str = ""
    """``controlled`` or ``autonomous``; of the reward nothing."""
    says: list[str] = field(default_factory=list)


def with_checks(rules: Sequence[Rule], checks: Sequence[Check]) -> Iterator[tuple[Rule, Check | None]]:
    """Yield every rule and, with the last of each list that is here, how it did; checks are in the order of lists."""
    of = {about: list(mine) for about, mine in groupby(checks, key=lambda check: check.about)}
    for about, group in groupby(rules, key=lambda rule: rule.about):
        mine, waiting = list(group), list(of.get(about, ()))
        left = waiting[0].rules if waiting else 0
        for i, rule in enumerate(mine):
            left -= 1
            ends = bool(waiting) and (left == 0 or i == len(mine) - 1)
            yield rule, waiting.pop(0) if ends else None
            left = waiting[0].rules if ends and waiting else left


def learned_of(player: Player, checks: Sequence[Check] = ()) -> list[Learned]:
    """Return the rules about concepts, those of each together, and checks of them; none where nothing is followed."""
    if player.planning is None:
        return []
    table = player.planning.concepts.table_
    found: dict[str, Learned] = {}
    for rule, check in with_checks(player.planning.concept_rules.rules(player.action_names), checks):
        name = rule.about.rsplit(" ", 1)[0]  # without the velocity
        if name in table.names:
            number = table.names.index(name)
            new = Learned(name=name, moved="controlled" if table.controlled[number] else "autonomous")
        else:
            new = Learned(name=rule.about)
        says = found.setdefault(new.name, new).says
        says.append(sentence(rule))
        if check:
            says.append(str(check))
    return list(found.values())


def rule_book_of(player: Player, *, most: int = MOST) -> RuleBook | None:
    """Return the same rules, to be asked which of them hold at a decision; None where that cannot be said."""
    world = player.planning.world_model if player.planning else None
    if not (world and world.is_fitted and isinstance(world, RulesThatFire)):
        return None
    return world.rule_book(player.encoder.space.fact_names, player.action_names, most=most, unit=unit_of(player))


def switch_rules(player: Player, off: Collection[str]) -> None:
    """Let the rules of some names (`Rule.key`) count for nothing in the plans of a player, and all others again.

    Where one holds, no change comes but what goes on by itself, no reward and no return. Names of rules that are not
    known, such as those of trees that have been grown anew since, are left out.
    """
    book = rule_book_of(player)
    if book is not None:
        assert player.planning is not None
        assert isinstance(player.planning.world_model, RulesThatFire)
        player.planning.world_model.switch_off(book.named(off))


def keys_of_rules(player: Player) -> dict[str, Rule]:
    """Return the rules of a player that can be switched off, by name: those of `semrl rules --trees`."""
    book = rule_book_of(player)
    return {rule.key: rule for rules in book.trees for rule in rules.by_support} if book else {}


def unit_of(player: Player) -> float:
    """Return in which unit facts are shown to people: what 1 means in it, as a share of their range."""
    return player.encoder.space.unit or 1.0
