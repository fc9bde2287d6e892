"""The rules by which a run foresees, for those who want to check them."""

from pathlib import Path

from semrl.errors import UsageError
from semrl.ontology import TreeWorld
from semrl.ontology.rules import Rule
from semrl.runs.maps import action_names
from semrl.runs.player import load_player

PERCENT = 0.01
"""Of the image, in which places of what is tracked are told."""


def load_rules(run: str | Path, *, most: int = 8) -> list[Rule]:
    """Read the rules that a run has learned, so many for each number of its state and for the reward.

    Raises
    ------
    UsageError
        When there is no such run, or its model of the world is not made of trees.
    """
    player = load_player(run)
    world = player.require_map(run).world
    if not isinstance(world, TreeWorld):
        raise UsageError(
            f"{run} foresees by networks, which have no rules to read; "
            "ask a run of model ram-map, or one trained with --reasoning.world trees"
        )
    if not world.is_fitted:
        raise UsageError(f"{run} has not learned any rules yet: it needs more frames")
    names = player.pipeline.names or tuple(f"number {i}" for i in range(player.pipeline.shape[0]))
    return world.rules(names, action_names(player), most=most, unit=PERCENT if player.pipeline.follows else None)
