"""The rules by which a run foresees, for those who want to check them."""

from pathlib import Path

from semrl.core.errors import UsageError
from semrl.evaluation.player import Player, load_player
from semrl.world_model import TreeWorld
from semrl.world_model.rules import Rule

MOST = 8
"""Rules for each number of a state, and for the reward, when nothing else is asked for."""

PERCENT = 0.01
"""Of the image, in which places of what is tracked are told."""


def load_rules(run: str | Path, *, most: int = MOST) -> list[Rule]:
    """Read the rules that a run has learned, so many for each number of its state and for the reward.

    Raises
    ------
    UsageError
        When there is no such run, or its model of the world is not made of trees.
    """
    player = load_player(run)
    world = player.require_foresight(run).world
    if not isinstance(world, TreeWorld):
        raise UsageError(
            f"{run} foresees by networks, which have no rules to read; "
            "ask a run of model ram-map, or one trained with --reasoning.world trees"
        )
    return rules_of(player, most=most)


def rules_of(player: Player, *, most: int = MOST) -> list[Rule]:
    """Return the rules of a player with a map; none where it foresees by networks, or nothing was learned."""
    world = player.reasoner.world if player.reasoner else None
    if not (isinstance(world, TreeWorld) and world.is_fitted):
        return []
    names = player.pipeline.names or tuple(f"number {i}" for i in range(player.pipeline.shape[0]))
    return world.rules(names, player.action_names, most=most, unit=unit_of(player))


def unit_of(player: Player) -> float:
    """Return in which unit the numbers of a state are told: what 1 means, as a share of their range."""
    if player.pipeline.follows:
        return PERCENT
    world = player.reasoner.world if player.reasoner else None
    return world.config.resolution if isinstance(world, TreeWorld) else 1.0
