"""Variants of Pong, by its RAM and its colours: other enemies, other looks of one thing."""

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np

from semrl.core import Frame
from semrl.envs.actions import Env
from semrl.envs.ram import GAMES
from semrl.envs.variants.frames import AlteredFrames

ENEMY_ADDRESS = 21
"""Where the emulator keeps the enemy's place: what is written there moves it, and is drawn with the next frame."""

BALL_X_ADDRESS = GAMES["pong"].ram_addresses["ball_x"]

FARTHEST = 8
"""A larger step of the enemy is no motion: it is put somewhere else after a point."""

LAST_PLACE = 196

FRAMES_OF_A_SPEED = 500
"""After so many frames an enemy of two speeds takes the other."""


class AlteredEnemy(gym.Wrapper[Any, Any, Any, Any]):
    """Scale every step of the enemy, frame by frame, in the emulator's RAM."""

    roms = ("pong",)
    fixed_pace: ClassVar[float] = 1.0

    def pace(self) -> float:
        """Return how far the enemy now goes in place of each step of its own; asked once a frame."""
        return self.fixed_pace

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Let the enemy go as far as its pace allows."""
        ale = self.unwrapped.ale  # type: ignore[attr-defined]
        before = int(ale.getRAM()[ENEMY_ADDRESS])
        result = self.env.step(action)
        step, pace = int(ale.getRAM()[ENEMY_ADDRESS]) - before, self.pace()
        if 0 < abs(step) <= FARTHEST:
            ale.setRAM(ENEMY_ADDRESS, int(np.clip(before + round(step * pace), 0, LAST_PLACE)))
        return result


class FrozenEnemy(AlteredEnemy):
    """It stays where a point begins."""

    fixed_pace = 0.0


class SlowEnemy(AlteredEnemy):
    """It is half as fast."""

    fixed_pace = 0.5


class FastEnemy(AlteredEnemy):
    """It is half as fast again."""

    fixed_pace = 1.5


class LazyEnemy(AlteredEnemy):
    """It moves only while the ball comes towards it."""

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        self._ball_x = 0

    def pace(self) -> float:
        """Rest while the ball flies to the right, or stands."""
        before = self._ball_x
        self._ball_x = int(self.unwrapped.ale.getRAM()[BALL_X_ADDRESS])  # type: ignore[attr-defined]
        return 1.0 if self._ball_x < before else 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a game."""
        self._ball_x = 0
        return super().reset(seed=seed, options=options)


class TwoSpeeds(AlteredEnemy):
    """It is slow and fast in turn."""

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        self._frames = 0

    def pace(self) -> float:
        """Return the speed of this part of the game."""
        return SlowEnemy.fixed_pace if self._frames // FRAMES_OF_A_SPEED % 2 == 0 else FastEnemy.fixed_pace

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Count the frames."""
        self._frames += 1
        return super().step(action)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a game."""
        self._frames = 0
        return super().reset(seed=seed, options=options)


class RecolouredThing(AlteredFrames):
    """One thing has another colour; it is known by its own within the field."""

    roms = ("pong",)
    field: ClassVar[slice] = slice(34, 194)
    """Rows of a frame between the walls."""
    colour: ClassVar[tuple[int, int, int]]
    instead: ClassVar[tuple[int, int, int]]

    def alter(self, frame: Frame) -> Frame:
        """Paint the thing."""
        painted = frame.copy()
        field = painted[self.field]
        field[(field == self.colour).all(axis=2)] = self.instead
        return painted


class RecolouredBall(RecolouredThing):
    """The ball is yellow."""

    colour = (236, 236, 236)
    instead = (236, 236, 70)


class RecolouredEnemy(RecolouredThing):
    """The enemy is blue."""

    colour = (213, 130, 74)
    instead = (84, 92, 214)


class DarkBall(RecolouredThing):
    """The ball is nearly black: darker than the background, where it was lighter."""

    colour = (236, 236, 236)
    instead = (20, 20, 40)
