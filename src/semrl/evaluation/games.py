"""The games of an evaluation: each is a function of its seed and number, so they can be played side by side."""

import contextlib
import multiprocessing
import signal
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from types import MappingProxyType
from typing import Any

from semrl.core.beside import alone
from semrl.core.errors import SemrlError, UsageError
from semrl.envs.actions import Env
from semrl.evaluation.player import Player, Policy, load_player
from semrl.evaluation.scene_classes import counting_classes
from semrl.evaluation.shield import shielded
from semrl.knowledge.edits import read_log
from semrl.training.loop import Step
from semrl.training.session import limited_threads


@dataclass(frozen=True, kw_only=True, slots=True)
class PlayedGame:
    """How one game went."""

    total: float
    decisions: int
    rewards: list[tuple[int, float]]
    """Decisions, from 0, that brought a reward, and which."""
    is_cut: bool
    """Whether it was ended before its end."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Asked:
    """Whose games are to be played; enough to load the player in another process."""

    run: str
    policy: Policy
    at: int | None
    conditions: tuple[tuple[str, Any], ...]
    seed: int

    def player(self) -> Player:
        """Load who plays; see `ready_player`."""
        return ready_player(self.run, self.policy, self.at, dict(self.conditions))


def ready_player(
    run: str | Path, policy: Policy, at: int | None = None, conditions: Mapping[str, Any] = MappingProxyType({})
) -> Player:
    """Load who is to play as in an evaluation, and check that it can.

    Raises
    ------
    UsageError
        When there is no such run or milestone, it has not learned to see, or it has no planner that is asked for.
    """
    memory = conditions.get("classes", "off") != "off" or bool(read_log(Path(run)))  # classes are learned from it
    player = load_player(run, at, memory=memory).under(**conditions)
    if player.perceiving:
        raise UsageError(
            f"{run} has not learned to see yet, so there is no agent to play with: it needs more decisions"
        )
    if policy == "planner":
        player.require_predictions(run)
    return shielded(counting_classes(player, run), run)


def play_games(
    asked: Asked,
    player: Player,
    env: Env,
    *,
    workers: int,
    on_episode: Callable[[float, int], None],
    on_step: Callable[[int, Step], None],
) -> list[PlayedGame]:
    """Play the games of an evaluation, some of them in other processes; see `semrl.evaluation.evaluate`.

    They are begun here from the first on and elsewhere from the last on. In the end this process plays too what others
    have not finished, and whoever comes first with a game counts: it is the same game.
    """
    episodes = player.config.evaluation.episodes
    waiting, games = deque(range(1, episodes)), list[PlayedGame]()
    with _elsewhere(asked, waiting, min(workers - 1, len(waiting))) as theirs:
        for episode in range(episodes):
            with contextlib.suppress(ValueError):  # others have begun it
                waiting.remove(episode)
            steps = player.episode(episode, asked.seed, asked.policy, env)
            game = theirs.get(episode) or _play(steps, partial(on_step, episode), lambda: episode in theirs)  # noqa: B023
            games.append(game or theirs[episode])
            on_episode(games[-1].total, games[-1].decisions)
    return games


def _play(
    steps: Iterator[Step], on_step: Callable[[Step], None], is_known: Callable[[], bool] = lambda: False
) -> PlayedGame | None:
    """Play an episode to its end; None where its end becomes known meanwhile."""
    rewards = []
    for step in steps:
        if is_known():
            return None
        if step.reward:
            rewards.append((step.number - 1, step.reward))
        on_step(step)
    return PlayedGame(total=step.total, decisions=step.number, rewards=rewards, is_cut=not step.done)


@contextlib.contextmanager
def _elsewhere(asked: Asked, waiting: "deque[int]", processes: int) -> Iterator[Mapping[int, PlayedGame]]:
    """Let other processes take the last game that waits whenever they have none; give what they have played."""
    played: dict[int, PlayedGame] = {}

    def keep_busy(line: Connection) -> None:
        with contextlib.suppress(IndexError, EOFError, OSError):  # none waits, or the process has failed
            while True:
                episode = waiting.pop()
                line.send(episode)
                played[episode] = line.recv()

    context = multiprocessing.get_context("spawn")
    with contextlib.ExitStack() as stack:
        if processes:
            stack.enter_context(alone())
        for _ in range(processes):
            line, end = context.Pipe()
            process = context.Process(target=_serve, args=(asked, end), daemon=True)
            process.start()
            stack.callback(process.join)
            stack.callback(process.kill)
            end.close()
            threading.Thread(target=keep_busy, args=(line,), daemon=True).start()
        yield played


def _serve(asked: Asked, line: Connection) -> None:
    """Play the games of the numbers that come, until nobody asks any more; what fails is played by who asks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asks ends this process
    warnings.simplefilter("ignore")  # and has warned
    with contextlib.suppress(SemrlError, EOFError, OSError):
        player = asked.player()
        with alone(), limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
            while True:
                episode = line.recv()
                line.send(_play(player.episode(episode, asked.seed, asked.policy, env), lambda _: None))
