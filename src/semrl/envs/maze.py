"""The maze of Fig. 2.2: the labyrinth on which §2.1 counts the values of a flat and of a hierarchical learner."""

from typing import Any

import gymnasium as gym
import numpy as np

from semrl.core import Image, Ints
from semrl.core.errors import DataError
from semrl.envs.rendering import check_render_mode

ROOM_SIDE_TILES = 5
MAZE_SIDE_TILES = 2 * ROOM_SIDE_TILES
N_TILES = MAZE_SIDE_TILES**2
OUTSIDE = -1
EAST, SOUTH, WEST, NORTH = range(4)  # clockwise, so that adding 1 modulo 4 turns an action to the right
STEPS = ((0, 1), (1, 0), (0, -1), (-1, 0))  # row and column, by action
DOOR_TILE = ROOM_SIDE_TILES // 2  # doorways are in the middle of the walls
EXIT = (DOOR_TILE, NORTH)  # the tile in the first row, and the action, that lead out of the labyrinth


def _next_tile(tile: int, action: int) -> int:
    """Return the tile after one move; a wall keeps the pawn where it is."""
    if (tile, action) == EXIT:
        return OUTSIDE
    here = np.array(divmod(tile, MAZE_SIDE_TILES))
    there = here + STEPS[action]
    if there.min() < 0 or there.max() >= MAZE_SIDE_TILES:
        return tile
    along_wall = here[1] if action in (SOUTH, NORTH) else here[0]
    leaves_room = (here // ROOM_SIDE_TILES != there // ROOM_SIDE_TILES).any()
    if leaves_room and along_wall % ROOM_SIDE_TILES != DOOR_TILE:
        return tile
    return int(there[0] * MAZE_SIDE_TILES + there[1])


TRANSITIONS: Ints = np.array([[_next_tile(tile, action) for action in range(4)] for tile in range(N_TILES)])
"""``(100, 4)`` int64: the tile that each action leads to from each tile, or `OUTSIDE`."""


def shortest_steps() -> Ints:
    """Return the fewest steps out of the maze from each tile, ``(100,)`` int64, by breadth-first search."""
    steps = np.zeros(N_TILES, dtype=np.int64)  # 0: not reached yet
    frontier = np.array([OUTSIDE])
    distance = 0
    while len(frontier):
        distance += 1
        frontier = np.flatnonzero(np.isin(TRANSITIONS, frontier).any(axis=1) & (steps == 0))
        steps[frontier] = distance
    return steps


class FourRooms(gym.Env[np.int64, np.int64]):
    """The labyrinth of Fig. 2.2: four rooms of 5 × 5 tiles in a ring, and one way out (§2.1).

    Tiles are numbered row by row, 0 … 99. Neighbouring rooms are joined by a doorway in the middle of
    their common wall; the way out is in the middle of the upper wall of the upper left room. The actions
    are 0 = EAST, 1 = SOUTH, 2 = WEST, 3 = NORTH; walking into a wall takes a step and leads nowhere. Each
    step costs 1, the last one too, so the undiscounted return is minus the length of the path. When the
    pawn is out, the observation is the tile that it left from.

    Parameters
    ----------
    render_mode
        ``None`` or ``"ansi"``; the latter makes `render` return the map as text.

    Raises
    ------
    UsageError
        An unknown render mode.
    """

    metadata = {"render_modes": ["ansi"], "render_fps": 4}  # noqa: RUF012

    def __init__(self, *, render_mode: str | None = None) -> None:
        check_render_mode(render_mode, self.metadata)
        self.render_mode = render_mode
        self.observation_space = gym.spaces.Discrete(N_TILES)
        self.action_space = gym.spaces.Discrete(4)
        self._tile = 0

    def get_action_meanings(self) -> list[str]:
        """Name the actions, in order."""
        return ["EAST", "SOUTH", "WEST", "NORTH"]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        """Put the pawn on a random tile, or on ``options["tile"]``.

        Raises
        ------
        DataError
            ``options["tile"]`` is not a tile, 0 … 99.
        """
        super().reset(seed=seed, options=options)
        tile = (options or {}).get("tile", self.np_random.integers(N_TILES))
        if not 0 <= tile < N_TILES:
            raise DataError(f"the maze has the tiles 0 to {N_TILES - 1}, not {tile}")
        self._tile = int(tile)
        return np.int64(tile), {}

    def step(self, action: np.int64 | int) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        """Move by one tile.

        Raises
        ------
        DataError
            `action` is not one of 0 … 3.
        """
        if not self.action_space.contains(action):
            raise DataError(f"FourRooms has the actions 0 to 3, not {action!r}")
        tile = int(TRANSITIONS[self._tile, action])
        self._tile = self._tile if tile == OUTSIDE else tile
        return np.int64(self._tile), -1.0, tile == OUTSIDE, False, {}

    def render(self) -> str | None:
        """Return ten lines with ``@`` for the pawn and ``.`` elsewhere, in the render mode ``"ansi"``."""
        if self.render_mode != "ansi":
            return None
        tiles = ["."] * N_TILES
        tiles[self._tile] = "@"
        rows = range(0, N_TILES, MAZE_SIDE_TILES)
        return "\n".join("".join(tiles[row : row + MAZE_SIDE_TILES]) for row in rows)


CELL_SIDE_PX = 4
_WALL, _FLOOR, _PAWN = (90, 90, 90), (0, 0, 0), (230, 60, 40)
_WAYS = (EAST, SOUTH, WEST, NORTH)


def draw_maze(tile: int) -> Image:
    """Return the labyrinth with the pawn on a tile, ``(84, 84, 3)`` uint8.

    A tile is one cell of 4 × 4 pixels, as is each wall or gap between two of them.
    """
    cells = np.empty((2 * MAZE_SIDE_TILES + 1, 2 * MAZE_SIDE_TILES + 1, 3), np.uint8)
    cells[:] = _WALL
    for place in range(N_TILES):
        row, column = 2 * np.array(divmod(place, MAZE_SIDE_TILES)) + 1
        cells[row, column] = _PAWN if place == tile else _FLOOR
        for action in _WAYS:
            if TRANSITIONS[place, action] != place:
                cells[row + STEPS[action][0], column + STEPS[action][1]] = _FLOOR
    return cells.repeat(CELL_SIDE_PX, axis=0).repeat(CELL_SIDE_PX, axis=1)


class DrawnFourRooms(gym.ObservationWrapper[Image, np.int64, np.int64]):
    """The same labyrinth, seen from above as pixels: see `draw_maze`."""

    def __init__(self, *, render_mode: str | None = None) -> None:
        super().__init__(FourRooms(render_mode=render_mode))
        self.observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)

    def observation(self, observation: np.int64) -> Image:
        """Return the picture of a tile."""
        return draw_maze(int(observation))
