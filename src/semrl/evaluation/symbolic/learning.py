"""Learning a discrete world: play that is random at first, and then tries what was never tried."""

import contextlib
from collections.abc import Callable

import numpy as np

from semrl.core.errors import UsageError
from semrl.envs import Game, make_env
from semrl.envs.actions import action_meanings
from semrl.envs.environment import EnvironmentConfig
from semrl.evaluation.symbolic.world import Record, SymbolicWorld
from semrl.perception.lattice import Lattice
from semrl.planning.symbolic.cells import CellConcepts
from semrl.planning.symbolic.operators import Operators
from semrl.planning.symbolic.search import nearest

LEARNING_DECISIONS = 2_000

_FIRST = 60
"""Random decisions before what was never tried is sought."""
_EVERY = 20
_EVERY_PART = 5
"""Decisions after which operators are learned anew: so many at least, and such a part of all."""
_FRAMES = 30
"""From which the side of a cell is found."""


def learn_world(
    env: str, *, decisions: int, seed: int = 0, on_decision: Callable[[int], None] = lambda _: None
) -> SymbolicWorld:
    """Play a discrete world and learn from it: at random first, then so as to try what was never tried.

    Parameters
    ----------
    env
        Environment; see `make_env`. A decision is one step.
    decisions
        To play.
    seed
        Of layouts and of what chance decides.
    on_decision
        Is told how many were played.

    Raises
    ------
    UsageError
        When the world is not discrete, or nothing moves in it.
    """
    if decisions < 1 or seed < 0:
        raise UsageError("decisions must be 1 or more, and seed 0 or more")
    rng = np.random.default_rng(seed)
    with contextlib.closing(make_env(env, EnvironmentConfig(frame_skip=1))) as made:
        game = Game(made, seed)
        world = SymbolicWorld(env=env, actions=tuple(action_meanings(made)), lattice=Lattice())
        world.lattice.fit(_frames(game, rng))
        chooser, played = _Curious(world, game.n_actions, rng), 0
        while played < decisions:
            observation = game.reset()
            record = Record(world.lattice.read(observation.frame))
            while not record.over and played < decisions:
                record.take(game, chooser.choose(record), world.lattice)
                played += 1
                on_decision(played)
            world.episodes.append(record.episode())
    return world


class _Curious:
    """Decides while learning."""

    def __init__(self, world: SymbolicWorld, n_actions: int, rng: np.random.Generator) -> None:
        self.world, self.n_actions, self.rng = world, n_actions, rng
        self.known: tuple[CellConcepts, Operators] | None = None
        self.since = self.played = 0
        self.waiting: list[int] = []

    def choose(self, record: Record) -> int:
        """Return the next action: the next step towards one that was not tried yet, or any."""
        self.played += 1
        self.since += 1
        if not record.actions:
            self.waiting = []
        if self.played > _FIRST and not self.waiting and self.rng.random() < 1 / 2:
            self._seek(record)
        if self.waiting:
            return self.waiting.pop(0)
        return int(self.rng.integers(self.n_actions))

    def _seek(self, record: Record) -> None:
        if self.known is None or self.since > max(_EVERY, self.played // _EVERY_PART):
            world = SymbolicWorld(env="", actions=(), lattice=self.world.lattice)
            world.episodes = [*self.world.episodes, *([record.episode()] if record.actions else [])]
            try:
                self.known = world.learn()
            except UsageError:
                return
            self.since = 0
        concepts, operators = self.known
        state = list(concepts.states(np.array(record.grids)))[-1]
        if state is None:
            return
        found = nearest(operators, state, lambda one: bool(operators.untried(one, self.n_actions)))
        if found is not None:
            new = operators.untried(found.states[-1], self.n_actions)
            self.waiting = [one.action for one in found.operators] + [int(self.rng.choice(new))]


def _frames(game: Game, rng: np.random.Generator) -> list[np.ndarray]:
    frames = [game.reset().frame]
    while len(frames) < _FRAMES:
        outcome = game.step(int(rng.integers(game.n_actions)))
        frames.append(game.reset().frame if outcome.done else outcome.observation.frame)
    return frames
