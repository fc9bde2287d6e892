"""The log of events of an episode that a run plays."""

import contextlib
from pathlib import Path
from typing import Any

from semrl.core import Scene
from semrl.core.errors import UsageError
from semrl.envs.actions import Env
from semrl.evaluation.player import Policy
from semrl.evaluation.scenes import load_concepts, play_scenes
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.knowledge.events import Event, events_of
from semrl.training.session import limited_threads


def load_events(
    run: str | Path, *, episode: int = 1, seed: int | None = None, policy: Policy = "agent", at: int | None = None
) -> list[Event]:
    """Play one episode and return what happened in it.

    Parameters
    ----------
    run
        Folder of a run that follows objects and has a map.
    episode
        Which one of those that `semrl eval` plays, from 1.
    seed
        Of the episodes; when None, one that training did not use.
    policy
        Who plays.
    at
        Decisions after which the run is asked: one of its milestones; as it is now when None.

    Raises
    ------
    UsageError
        When there is no such run or milestone, or it knows no concepts.
    """
    if episode < 1 or (seed is not None and seed < 0):
        raise UsageError(f"episode must be 1 or more and seed 0 or more, not {episode} and {seed}")
    player, table = load_concepts(run, at)
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    scenes: list[Scene] = []
    rewards: list[float] = []
    lives: list[int] = []
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        for step, scene in play_scenes(player, run, number=episode - 1, seed=seed, policy=policy, env=env):
            scenes.append(scene)
            lives.append(lives_left(env))
            if step.action is not None:
                rewards.append(step.reward)
    return events_of(scenes, table, rewards, lives)


def lives_left(env: Env) -> int:
    """Return how many lives the player of an Atari game has left; 0 in other worlds."""
    emulator: Any = getattr(env.unwrapped, "ale", None)
    return int(emulator.lives()) if emulator is not None else 0
