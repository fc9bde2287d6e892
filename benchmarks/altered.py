"""Play on in another world: Pong with an enemy that is frozen, slowed or made faster, at evaluation only.

Trained runs play as they are. For those with a map the planner plays once more after its model saw some decisions of
the new world.

    python benchmarks/altered.py runs/x runs/y --episodes 10
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import gymnasium as gym
import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl.envs.actions import Env, choose_actions
from semrl.envs.environment import FrameSkip, NoopStart
from semrl.evaluation import load_player
from semrl.evaluation.player import Player, Policy
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.training.session import limited_threads
from semrl.world_model import TreeWorld

ENEMY_ADDRESS = 21
"""Where the emulator keeps the enemy's place: what is written there moves it, and is drawn with the next frame."""

PONG_ACTIONS = ("NOOP", "FIRE", "RIGHT", "LEFT", "RIGHTFIRE", "LEFTFIRE")
"""All of them, since a game begins with some that the agent does not have."""

FARTHEST = 8
"""A larger step is no motion: the enemy is put somewhere else after a point."""

LAST_PLACE = 196

LONGEST = 16_000
"""Decisions of a game: after 65,212 frames the cartridge ends it and sets its score back, which counts as points."""

WORLDS = {"as trained": 1.0, "frozen": 0.0, "slowed": 0.5, "faster": 1.5}
"""How far the enemy goes in place of each step of its own."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play with an altered enemy."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Trained runs of Pong."""
    episodes: int = 10
    """Games of each policy in each world."""
    adapting: int = 1_000
    """Decisions of the new world from which the planner's model learns before it plays once more."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """What a policy got in a world."""

    run: str
    world: str
    policy: str
    mean: float
    min: float
    max: float
    decisions: float
    """Mean length of a game, 16,000 at most: of games that nobody wins, how slowly they are lost."""


class AlteredEnemy(gym.Wrapper[Any, Any, Any, Any]):
    """Scale every step of Pong's enemy, frame by frame, in the emulator's RAM."""

    def __init__(self, env: Env, pace: float) -> None:
        super().__init__(env)
        self.pace = pace

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Let the enemy go as far as its pace allows."""
        ale = self.unwrapped.ale  # type: ignore[attr-defined]
        before = int(ale.getRAM()[ENEMY_ADDRESS])
        result = self.env.step(action)
        step = int(ale.getRAM()[ENEMY_ADDRESS]) - before
        if 0 < abs(step) <= FARTHEST:
            ale.setRAM(ENEMY_ADDRESS, int(np.clip(before + round(step * self.pace), 0, LAST_PLACE)))
        return result


def main(arguments: Arguments) -> None:
    """Play in every world and print the table."""
    if not arguments.runs:
        raise UsageError("name at least one trained run of Pong")
    scores = [score for run in arguments.runs for score in play(run, arguments)]
    if arguments.json:
        print(json.dumps({"machine": machine.describe(), "scores": [asdict(score) for score in scores]}))
        return
    table = Table("run", "world", "policy", "mean", "min … max", "decisions a game", box=None, padding=(0, 2, 0, 0))
    for score in scores:
        extremes = f"{score.min:.0f} … {score.max:.0f}"
        table.add_row(score.run, score.world, score.policy, f"{score.mean:.2f}", extremes, f"{score.decisions:,.0f}")
    Console().print(table)


def play(run: Path, arguments: Arguments) -> Iterator[Score]:
    """Play with every policy of a run in every world."""
    for world, pace in WORLDS.items():
        player = load_player(run, memory=True)
        with limited_threads(player.config.threads):
            policies: tuple[Policy, ...] = ("agent", "planner") if player.planning else ("agent",)
            for policy in policies:
                yield _score(run, world, policy, _games(player, pace, policy, arguments.episodes))
            if player.planning and pace != 1:
                adapt(player, pace, arguments.adapting)
                told = f"planner, after {arguments.adapting:,} decisions"
                yield _score(run, world, told, _games(player, pace, "planner", arguments.episodes))


def altered_game(player: Player, pace: float, seed: int) -> Game:
    """Make the game that a run was trained on, with an altered enemy."""
    own = player.config.environment
    every_frame = EnvironmentConfig(frame_skip=1, sticky_actions=own.sticky_actions, actions=PONG_ACTIONS)
    env: Env = FrameSkip(AlteredEnemy(make_env(player.config.env, every_frame), pace), own.frame_skip)
    return Game(choose_actions(NoopStart(env, player.config.evaluation.max_noops), own.actions), seed)


def adapt(player: Player, pace: float, decisions: int) -> None:
    """Let the planner play in the altered world, and its model learn from that beside what it remembers."""
    planning = player.planning
    assert planning is not None
    world = planning.world_model
    assert isinstance(world, TreeWorld), "the preset's models of the world are trees"
    world.config = replace(world.config, new_decisions=1, new_share=0.0)  # so little is nothing new to it otherwise
    learned = episode = 0
    while learned < decisions:
        rng = np.random.default_rng([EVALUATION_SEED, 1, episode])
        steps = player.play(altered_game(player, pace, int(rng.integers(2**31))), rng, "planner")
        for step in steps:
            last = step
            learned += step.action is not None
            if learned == decisions:
                break
        assert last.state is not None
        planning.end_episode(last.state.facts, last.state.things)
        episode += 1


def _games(player: Player, pace: float, policy: Policy, episodes: int) -> list[tuple[float, int]]:
    """Play, and return of each game the return and how many decisions it took."""
    games = []
    for episode in range(episodes):
        rng = np.random.default_rng([EVALUATION_SEED, 0, episode])
        decisions = 0
        steps = player.play(altered_game(player, pace, int(rng.integers(2**31))), rng, policy)
        for step in islice(steps, LONGEST + 1):
            total = step.total
            decisions += step.action is not None
        games.append((total, decisions))
    return games


def _score(run: Path, world: str, policy: str, games: list[tuple[float, int]]) -> Score:
    returns, decisions = zip(*games, strict=True)
    return Score(
        run=str(run),
        world=world,
        policy=policy,
        mean=float(np.mean(returns)),
        min=min(returns),
        max=max(returns),
        decisions=float(np.mean(decisions)),
    )


if __name__ == "__main__":
    main(tyro.cli(Arguments))
