"""Learning a discrete world: play that is random at first, and then tries what was never tried."""

import contextlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from semrl.core.errors import UsageError
from semrl.envs import Game, make_env
from semrl.envs.actions import action_meanings
from semrl.envs.environment import EnvironmentConfig
from semrl.evaluation.symbolic.world import Record, SymbolicWorld
from semrl.perception.lattice import Lattice
from semrl.planning.symbolic.cells import CellConcepts, GridState
from semrl.planning.symbolic.operators import Context, Operators, Trial
from semrl.planning.symbolic.search import SymbolicGoal, nearest, search

LEARNING_DECISIONS = 2_000

_FIRST = 60
"""Random decisions before what was never tried is sought."""
_EVERY = 20
_EVERY_PART = 10
"""Decisions after which operators are learned anew: so many at least, and such a part of all."""
_AT_RANDOM = 0.25
"""Share of decisions that chance takes where no plan is being carried out."""
_MOST_STATES = 2_000
"""That are looked at for something that was never tried."""
_ANYHOW = 20
"""Decisions that chance takes where nothing is found, before another layout begins."""
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
        Called with how many were played.

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
            chooser.begin()
            while not record.over and played < decisions and not chooser.bored:
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
        self.state: GridState | None = None
        self.since = self.played = 0
        self.tried = set[Trial]()
        self.waiting: list[int] = []
        self.bored = self.giving_up = False
        """Whether another layout should begin."""

    def begin(self) -> None:
        """Begin an episode."""
        self.waiting, self.state = [], None
        self.bored = self.giving_up = False

    def choose(self, record: Record) -> int:
        """Return the next action: the next step towards one that was not tried yet, or any."""
        self._see(record)
        self.played += 1
        self.since += 1
        if not self.waiting and self.state is not None and self.rng.random() >= _AT_RANDOM:
            self._seek()
        self.bored = self.giving_up and len(self.waiting) <= 1
        action = self.waiting.pop(0) if self.waiting else int(self.rng.integers(self.n_actions))
        if self.known is not None and self.state is not None:
            operators = self.known[1]
            self.tried |= set(operators.met(action, operators.context(self.state)))
        return action

    def _see(self, record: Record) -> None:
        """Take in what is seen, and learn anew when it is time to."""
        if self.played >= _FIRST and self.since > max(_EVERY, self.played // _EVERY_PART):
            self._learn(record)
        elif self.known is not None:
            self.state = self.known[0].state(record.grids[-1], self.state) or self.state

    def _learn(self, record: Record) -> None:
        world = replace(self.world, episodes=[*self.world.episodes, record.episode()])
        self.since = 0
        with contextlib.suppress(UsageError):  # when nothing has moved yet
            self.known = world.learn()
            self.tried.clear()
            *_, self.state = self.known[0].states(record.grids)

    def _seek(self) -> None:
        """Plan to where something was never tried; where nothing is left to try, to a gain, and then elsewhere."""
        assert self.known is not None
        assert self.state is not None
        operators = self.known[1]
        untried: dict[Context, list[int]] = {}

        def new(state: GridState) -> list[int]:
            context = operators.context(state)
            if context not in untried:
                untried[context] = operators.untried(context, self.n_actions, self.tried)
            return untried[context]

        found = nearest(operators, self.state, lambda state: bool(new(state)), _MOST_STATES)
        if found is not None:
            self.waiting = [one.action for one in found.operators] + [int(self.rng.choice(new(found.states[-1])))]
            return
        gain = search(operators, self.state, SymbolicGoal(event="gain"), _MOST_STATES)
        self.giving_up = gain is None
        at_random = [int(action) for action in self.rng.integers(self.n_actions, size=_ANYHOW)]
        self.waiting = [one.action for one in gain.operators] if gain else at_random


def _frames(game: Game, rng: np.random.Generator) -> list[np.ndarray]:
    frames = [game.reset().frame]
    while len(frames) < _FRAMES:
        outcome = game.step(int(rng.integers(game.n_actions)))
        frames.append(game.reset().frame if outcome.done else outcome.observation.frame)
    return frames
