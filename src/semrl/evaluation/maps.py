"""The map of a run and the rules behind it, for those who want to look at them."""

from dataclasses import dataclass
from pathlib import Path

from semrl.core import MapGraph
from semrl.evaluation.player import load_player
from semrl.evaluation.rules import tree_rules_of
from semrl.training.folder import RunFolder
from semrl.world_model.rules import Rule


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadedMap:
    """The map of a run, as of its newest checkpoint, the names of its actions, and the rules by which it predicts."""

    graph: MapGraph
    action_names: tuple[str, ...]
    rules: tuple[Rule, ...]
    base: str
    """What the names of its states, transitions, actions and rules begin with, as IRIs."""


def load_map(run: str | Path) -> LoadedMap:
    """Read the map of a run.

    Raises
    ------
    UsageError
        When there is no such run, or it has no map.

    Examples
    --------
    With the run of the page *Start*:

    >>> loaded = load_map("runs/catch")
    >>> loaded.action_names
    ('LEFT', 'RIGHT')
    """
    player = load_player(run)
    graph = player.require_map(run).state_map.graph_
    return LoadedMap(
        graph=graph,
        action_names=player.action_names,
        rules=tuple(tree_rules_of(player)),
        base=RunFolder.open(Path(run)).base_iri,
    )
