"""The scenes of an episode: what a run sees, each thing of a concept that it has learned."""

from collections.abc import Iterator
from pathlib import Path

from semrl.core import ConceptTable, Scene
from semrl.core.errors import UsageError
from semrl.envs.actions import Env
from semrl.evaluation.player import Player, Policy, load_player
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.planning.module import PlanningModule
from semrl.training.loop import Step


def load_concepts(run: str | Path, at: int | None = None) -> tuple[Player, ConceptTable]:
    """Return the player of a run and the concepts that it has learned.

    Raises
    ------
    UsageError
        When there is no such run or milestone, or it knows no concepts.
    """
    player = load_player(run, at)
    return player, player_concepts(player, run).concepts.table_


def player_concepts(player: Player, run: str | Path) -> PlanningModule:
    """Return the planning module of a player, which knows its concepts.

    Raises
    ------
    UsageError
        When it knows none; the message names the run.
    """
    planning = player.require_map(run)
    if not planning.concepts.is_fitted:
        raise UsageError(
            f"{run} knows no concepts: its model '{player.config.model}' follows no objects, or it was trained before "
            "there were any; train one with --model objects-map"
        )
    return planning


def play_scenes(
    player: Player,
    run: str | Path,
    *,
    number: int = 0,
    seed: int | None = None,
    policy: Policy = "agent",
    env: Env | None = None,
) -> Iterator[tuple[Step, Scene]]:
    """Play one of the episodes of an evaluation; yield every step and the scene that is seen at it.

    Raises
    ------
    UsageError
        When the run knows no concepts.
    """
    planning = player_concepts(player, run)
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    for step in player.episode(number, seed, policy, env):
        assert step.record is not None
        yield step, planning.scene(step.record.history)
