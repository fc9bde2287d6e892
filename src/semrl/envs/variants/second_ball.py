"""A variant of Pong with a second ball, which is drawn, bounces and counts as the first one does."""

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.core import Frame
from semrl.envs.actions import Env
from semrl.envs.variants.pong import RecolouredBall, RecolouredEnemy, RecolouredThing

SCORE_ADDRESSES = {"enemy": 13, "own": 14}
"""Where the emulator keeps the points: what is added there is drawn, rewarded, and ends the game at 21."""

OWN_COLOUR = (92, 186, 92)
ENEMY_COLUMNS, OWN_COLUMNS = (16, 20), (140, 144)

WIDTH, HEIGHT = 2, 4
"""Of a ball, in pixels of the frame."""

REST_FRAMES = 60
"""Between a point and the next serve."""

SPEEDS = (-2, -1, 0, 1, 2)
"""Down a frame: from the uppermost part of a paddle that hits it to the lowest."""


class SecondBall(gym.Wrapper[Any, Any, Any, Any]):
    """There are two balls. The enemy sees the first one only, and hits the other when it is in its way."""

    roms = ("pong",)
    field: ClassVar[slice] = RecolouredThing.field

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        self._rng = np.random.default_rng()
        self._begin()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a game."""
        frame, info = self.env.reset(seed=seed, options=options)
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        self._begin()
        return self._drawn(frame), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Let both balls fly on by a frame; a point of the second one is rewarded with the next frame."""
        frame, reward, terminated, truncated, info = self.env.step(action)
        self._fly(frame)
        return self._drawn(frame), reward, terminated, truncated, info

    def render(self) -> Any:
        """Draw it into what is rendered."""
        frame = self.env.render()
        return self._drawn(frame) if isinstance(frame, np.ndarray) else frame

    def _begin(self) -> None:
        self._x, self._y, self._rest = 0, 0, 2 * REST_FRAMES  # so that it comes in between those of the first
        self._speed_x, self._speed_y = 1, 0

    def _fly(self, frame: Frame) -> None:
        if self._rest:
            self._rest -= 1
            if not self._rest:
                self._x, self._y = 79, int(self._rng.integers(self.field.start + 30, self.field.stop - 30))
                self._speed_y = int(self._rng.choice([-2, -1, 1, 2]))
            return
        self._x += self._speed_x
        self._y += self._speed_y
        top, bottom = self.field.start, self.field.stop - HEIGHT
        if not top <= self._y <= bottom:
            self._y, self._speed_y = min(max(self._y, top), bottom), -self._speed_y
        self._meet(frame)
        if not 0 < self._x < frame.shape[1] - WIDTH:
            self._count("own" if self._speed_x < 0 else "enemy")

    def _meet(self, frame: Frame) -> None:
        """Bounce off a paddle, in the direction of the part of it that was hit."""
        left, right = OWN_COLUMNS if self._speed_x > 0 else ENEMY_COLUMNS
        if not left - WIDTH < self._x < right:
            return
        colour = OWN_COLOUR if self._speed_x > 0 else RecolouredEnemy.colour
        rows = np.flatnonzero((frame[self.field, left] == colour).all(axis=1)) + self.field.start
        if not len(rows) or not rows[0] - HEIGHT < self._y <= rows[-1]:
            return
        part = (self._y + HEIGHT - 1 - rows[0]) / (rows[-1] - rows[0] + HEIGHT)  # 0 … 1
        self._speed_x = -1 if self._speed_x > 0 else 1
        self._speed_y = SPEEDS[min(int(part * len(SPEEDS)), len(SPEEDS) - 1)]

    def _count(self, winner: str) -> None:
        """Note a point; the next serve flies to who lost it."""
        ale = self.unwrapped.ale  # type: ignore[attr-defined]
        address = SCORE_ADDRESSES[winner]
        ale.setRAM(address, int(ale.getRAM()[address]) + 1)
        self._rest, self._speed_x = REST_FRAMES, 1 if winner == "enemy" else -1

    def _drawn(self, frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if self._rest:
            return frame
        drawn = frame.copy()
        drawn[self._y : self._y + HEIGHT, self._x : self._x + WIDTH] = RecolouredBall.colour
        return drawn
