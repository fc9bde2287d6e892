"""The map of a run, for those who want to look at it."""

from dataclasses import dataclass
from pathlib import Path

from semrl.runs.player import Player, load_player
from semrl.state import played_actions
from semrl.types import MapGraph


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadedMap:
    """The map of a run, as of its newest checkpoint, and the names of its actions."""

    graph: MapGraph
    action_names: tuple[str, ...]


def load_map(run: str | Path) -> LoadedMap:
    """Read the map of a run.

    Raises
    ------
    UsageError
        When there is no such run, or it has no map.
    """
    player = load_player(run)
    graph = player.require_map(run).state_map.graph_
    return LoadedMap(graph=graph, action_names=action_names(player))


def action_names(player: Player) -> tuple[str, ...]:
    """Return the names of the actions that a run plays with, by number."""
    return played_actions(player.new_game(0).env, player.config.environment.actions)
