"""A ball to catch: a small Gymnasium world without a ROM.

It draws frames that the detector of §3.2.1 can take apart, so that the whole pipeline runs on it in seconds.
"""

from typing import Any, Literal

import gymnasium as gym
import numpy as np

from semrl.core import Floats, Frame
from semrl.core.errors import DataError, UsageError
from semrl.envs.rendering import check_render_mode

FIELD_PX = 84
FRAME_SCALE = 2  # a frame is exactly twice the preprocessed image, so that resizing by area blurs no edge
WALL_PX = 2
BALL_PX = 3
PADDLE_SIZE_PX = (3, 16)
PADDLE_ROW_PX = 79
PADDLE_STEP_PX = 2  # 8 px a decision of 4 frames: with two actions only, 2 × 8 px must fit the catching range
FALL_PX = 2
MAX_DRIFT_PX = 2
FIRST_ROW_PX, LAST_ROW_PX = 4, 76  # 36 frames = 9 decisions of 4 frames for each ball
# Two dark pixels stay between a wall and whatever moves: touching objects would be one component.
FIRST_COLUMN_PX = WALL_PX + 2
LAST_BALL_COLUMN_PX = FIELD_PX - FIRST_COLUMN_PX - BALL_PX
LAST_PADDLE_COLUMN_PX = FIELD_PX - FIRST_COLUMN_PX - PADDLE_SIZE_PX[1]

WALL_COLOUR = (142, 142, 142)
BALL_COLOUR = (236, 236, 236)
PADDLE_COLOUR = (92, 186, 92)


class Catch(gym.Env[np.ndarray[Any, Any], np.int64]):
    """Move a paddle under falling balls: +1 for each ball caught, −1 for each missed.

    A ball starts at the top in a random column with a random sideways speed and bounces off the side
    walls. It is judged when it comes down to the paddle, and the next one starts in the same frame. The
    actions are 0 = LEFT and 1 = RIGHT. Every ball can be caught, with and without a frame skip of 4.

    Parameters
    ----------
    observation
        ``"frame"``: RGB, ``(168, 168, 3)`` uint8. ``"vector"``: `coordinates`, ``(4,)`` float32.
    balls
        Balls an episode; the return lies in −balls … balls. An episode has 36 frames a ball.
    render_mode
        ``None`` or ``"rgb_array"``; the latter makes `render` return the frame.

    Raises
    ------
    UsageError
        An unknown observation or render mode, or no balls.

    Notes
    -----
    All randomness is ``self.np_random``: a seed and a list of actions determine the episode. Each ``info``
    holds ``"coordinates"``, whatever is observed.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 60}  # noqa: RUF012 (Gymnasium declares it so)

    def __init__(
        self,
        *,
        observation: Literal["frame", "vector"] = "frame",
        balls: int = 5,
        render_mode: str | None = None,
    ) -> None:
        if observation not in ("frame", "vector") or balls < 1:
            raise UsageError(f"Catch cannot show {observation!r} of {balls} balls")
        check_render_mode(render_mode, self.metadata)
        self.observation = observation
        self.balls = balls
        self.render_mode = render_mode
        side = FIELD_PX * FRAME_SCALE
        self.observation_space = (
            gym.spaces.Box(0, 255, (side, side, 3), np.uint8)
            if observation == "frame"
            else gym.spaces.Box(0.0, 1.0, (4,), np.float32)
        )
        self.action_space = gym.spaces.Discrete(2)
        self._balls_left = balls
        self._ball = (FIRST_ROW_PX, FIRST_COLUMN_PX)
        self._drift = 0
        self._paddle_column = FIRST_COLUMN_PX

    def get_action_meanings(self) -> list[str]:
        """Name the actions, in order, as Atari environments do."""
        return ["LEFT", "RIGHT"]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray[Any, Any], dict[str, Any]]:
        """Start an episode: paddle in the middle, a new ball at the top; `options` are ignored."""
        super().reset(seed=seed, options=options)
        self._balls_left = self.balls
        self._paddle_column = (FIRST_COLUMN_PX + LAST_PADDLE_COLUMN_PX) // 2
        self._drop()
        return self._observe()

    def step(self, action: np.int64 | int) -> tuple[np.ndarray[Any, Any], float, bool, bool, dict[str, Any]]:
        """Play one frame.

        Raises
        ------
        DataError
            `action` is neither 0 nor 1.
        """
        if not self.action_space.contains(action):
            raise DataError(f"Catch has the actions 0 and 1, not {action!r}")
        moved = self._paddle_column + (PADDLE_STEP_PX if action == 1 else -PADDLE_STEP_PX)
        self._paddle_column = min(max(moved, FIRST_COLUMN_PX), LAST_PADDLE_COLUMN_PX)
        self._fall()
        reward = 0.0
        if self._ball[0] >= LAST_ROW_PX:
            reward = 1.0 if self._is_under_ball() else -1.0
            self._balls_left -= 1
            self._drop()
        observation, info = self._observe()
        return observation, reward, self._balls_left <= 0, False, info

    def render(self) -> Frame | None:
        """Return the frame, ``(168, 168, 3)`` uint8, in the render mode ``"rgb_array"``."""
        return self.frame() if self.render_mode == "rgb_array" else None

    def coordinates(self) -> Floats:
        """Return ball row, ball column, ball drift and paddle column, ``(4,)`` float32, each in 0 … 1.

        Rows and columns are those of the left upper corner, as a share of the range in which the object
        moves; a drift of ½ is straight down. Together they determine what each action leads to, up to the
        next ball.
        """
        ball_row, ball_column = self._ball
        values = (ball_row, ball_column, self._drift, self._paddle_column)
        low = np.array([FIRST_ROW_PX, FIRST_COLUMN_PX, -MAX_DRIFT_PX, FIRST_COLUMN_PX])
        high = np.array([LAST_ROW_PX, LAST_BALL_COLUMN_PX, MAX_DRIFT_PX, LAST_PADDLE_COLUMN_PX])
        return np.asarray((values - low) / (high - low), dtype=np.float32)

    def frame(self) -> Frame:
        """Draw ball, paddle and the two side walls on black, ``(168, 168, 3)`` uint8."""
        field = np.zeros((FIELD_PX, FIELD_PX, 3), np.uint8)
        field[:, :WALL_PX] = field[:, -WALL_PX:] = WALL_COLOUR
        row, column = self._ball
        field[row : row + BALL_PX, column : column + BALL_PX] = BALL_COLOUR
        height, width = PADDLE_SIZE_PX
        left = self._paddle_column
        field[PADDLE_ROW_PX : PADDLE_ROW_PX + height, left : left + width] = PADDLE_COLOUR
        return field.repeat(FRAME_SCALE, axis=0).repeat(FRAME_SCALE, axis=1)

    def _observe(self) -> tuple[np.ndarray[Any, Any], dict[str, Any]]:
        coordinates = self.coordinates()
        observed = self.frame() if self.observation == "frame" else coordinates.copy()
        return observed, {"coordinates": coordinates}

    def _drop(self) -> None:
        """Start the next ball."""
        self._ball = (FIRST_ROW_PX, int(self.np_random.integers(FIRST_COLUMN_PX, LAST_BALL_COLUMN_PX + 1)))
        self._drift = int(self.np_random.integers(-MAX_DRIFT_PX, MAX_DRIFT_PX + 1))

    def _fall(self) -> None:
        """Move the ball by one frame; at a wall it is thrown back by what it would have gone too far."""
        row, column = self._ball[0] + FALL_PX, self._ball[1] + self._drift
        if not FIRST_COLUMN_PX <= column <= LAST_BALL_COLUMN_PX:
            wall = FIRST_COLUMN_PX if column < FIRST_COLUMN_PX else LAST_BALL_COLUMN_PX
            column = 2 * wall - column
            self._drift = -self._drift
        self._ball = (row, column)

    def _is_under_ball(self) -> bool:
        """Tell whether paddle and ball share at least one column."""
        return -PADDLE_SIZE_PX[1] < self._paddle_column - self._ball[1] < BALL_PX
