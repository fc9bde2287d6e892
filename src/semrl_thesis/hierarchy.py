"""Q-learning as the two-level hierarchy of §2.1, for the four-room maze."""

from dataclasses import dataclass

import numpy as np

from semrl.core import Ints
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.envs.maze import MAZE_SIDE_TILES, ROOM_SIDE_TILES
from semrl_thesis.tabular import QLearning, QLearningConfig, Values, argmax, check_shares


def _room_maps() -> tuple[Ints, Ints]:
    """Return the room of each tile and its number within the turned room, both ``(100,)``."""
    side = ROOM_SIDE_TILES
    rooms = np.empty((MAZE_SIDE_TILES, MAZE_SIDE_TILES), dtype=np.int64)
    local = np.empty_like(rooms)
    corners = ((0, 0), (0, side), (side, side), (side, 0))  # clockwise from the upper left
    for room, ((row, column), turns) in enumerate(zip(corners, ROOM_TURNS, strict=True)):
        block = np.s_[row : row + side, column : column + side]
        rooms[block] = room
        local[block] = np.rot90(np.arange(side**2).reshape(side, side), -turns)
    return rooms.ravel(), local.ravel()


N_ROOMS, N_EXITS, N_MOVES = 4, 2, 4
ROOM_TILES = ROOM_SIDE_TILES**2
ROOM_TURNS = (3, 1, 2, 3)
"""By how many quarter turns clockwise a standard room, with its exits east and south, becomes each room."""

ROOM_OF, LOCAL_TILE = _room_maps()


@dataclass(frozen=True, kw_only=True)
class MazeHierarchyConfig:
    """How a `MazeHierarchy` learns and explores.

    Raises
    ------
    UsageError
        A share lies outside 0 … 1, or the fine is too small to make a wrong exit worse than any path.
    """

    learning_rate: float = 0.5
    """α of eq. 2.1 on both levels, in 0 … 1."""

    exploration: float = 0.1
    """ε, the share of moves made at random, in 0 … 1."""

    wrong_exit_fine: float = 25.0
    """What a subtask pays for leaving by another exit, in steps; at least 25, the tiles of a room."""

    def __post_init__(self) -> None:
        check_shares(learning_rate=self.learning_rate, exploration=self.exploration)
        if self.wrong_exit_fine < ROOM_TILES:
            raise UsageError(f"wrong_exit_fine must be at least {ROOM_TILES}, not {self.wrong_exit_fine}")


class MazeHierarchy:
    """Two-level Q-learning for `FourRooms`: 8 + 200 values in place of 400 (§2.1, Fig. 2.2).

    The high level chooses by which of its two exits to leave a room, the low level walks there. Exits and
    tiles are told in coordinates of a standard room, with exit 0 in the middle of its east wall and exit 1
    in the middle of its south wall. Turned by quarters it covers each of the four rooms, so one low-level
    table serves all. Exit 0 leads clockwise round the ring and exit 1 anticlockwise, except in the upper
    left room, where exit 0 is the way out and exit 1 leads clockwise: the outside counts as one of its two
    neighbours, and its third door is no choice. A move through that door, a wall in the other rooms, is the
    one move whose effect differs between rooms; it is never the best one.

    The value of leaving by an exit is split as in MAXQ (Dietterich, 2000): what the way to the exit costs,
    which the low level knows for each tile, plus what is left to do afterwards (*completion*), which is the
    same from all tiles of a room because a doorway leads to one tile. Hence 4 × 2 completion values are
    enough, and there is no discount: with one, completion would depend on the length of the way.

    Such a hierarchy is in general only recursively optimal: subtasks know nothing of what comes after
    them. Here nothing is lost and paths are as short as possible, because doorways are one tile wide
    and no shortest path uses the door that is left out. Were the choice made by room alone, without the
    low level's cost, it would lose up to 4 steps in the room opposite the exit's.

    Moves are chosen anew at each step from the top (Dietterich's polling execution), so nothing has to be
    remembered between steps. Learning is off-policy: each step teaches the subtasks of both exits.

    Parameters
    ----------
    config
        Learning rate, exploration, fine.

    Attributes
    ----------
    completion_ : QLearning
        High level, ``(4, 2)``: minus the steps to the outside that remain after leaving room r by exit e.
    subtask_ : QLearning
        Low level, ``(2 × 25, 4)``: for exit e and tile t, row ``25 e + t``; moves are turned with the room.
    """

    def __init__(self, config: MazeHierarchyConfig) -> None:
        self.config = config
        shared = QLearningConfig(learning_rate=config.learning_rate, discount=1.0, exploration=config.exploration)
        self.completion_ = QLearning(shared, n_states=N_ROOMS, n_actions=N_EXITS)
        self.subtask_ = QLearning(shared, n_states=N_EXITS * ROOM_TILES, n_actions=N_MOVES)

    @property
    def n_values(self) -> int:
        """How many Q-values there are to learn: 8 + 200."""
        return self.completion_.n_values + self.subtask_.n_values

    def exit_values(self, state: int) -> Values:
        """Return the value of each exit of a tile's room, ``(2,)``: minus the steps to the outside by it."""
        ways = self.subtask_.values_.reshape(N_EXITS, ROOM_TILES, N_MOVES)[:, LOCAL_TILE[state]].max(axis=1)
        return np.asarray(ways + self.completion_.values_[ROOM_OF[state]])

    def act(self, state: int, rng: np.random.Generator) -> int:
        """Choose a move from tile `state`: at random with probability ε, else the `greedy` one."""
        if rng.random() < self.config.exploration:
            return int(rng.integers(N_MOVES))
        return self.greedy(state, rng)

    def greedy(self, state: int, rng: np.random.Generator) -> int:
        """Choose the best exit, then the best move towards it; among equals, at random."""
        exit_ = argmax(self.exit_values(state), rng)
        move = self.subtask_.greedy(exit_ * ROOM_TILES + int(LOCAL_TILE[state]), rng)
        return (move + ROOM_TURNS[ROOM_OF[state]]) % N_MOVES

    def update(self, state: int, action: int, reward: float, next_state: int, terminated: bool) -> None:
        """Learn from one step on both levels, each by eq. 2.1; parameters as for `QLearning.update`."""
        room = int(ROOM_OF[state])
        tile, next_tile = int(LOCAL_TILE[state]), int(LOCAL_TILE[next_state])
        move = (action - ROOM_TURNS[room]) % N_MOVES
        left_room = terminated or room != ROOM_OF[next_state]
        for exit_ in range(N_EXITS):
            # A room is left through one door per wall, so the move that crosses it names the exit.
            fine = self.config.wrong_exit_fine if left_room and move != exit_ else 0.0
            rows = exit_ * ROOM_TILES + tile, exit_ * ROOM_TILES + next_tile
            self.subtask_.update(rows[0], move, reward - fine, rows[1], left_room)
        if left_room and move < N_EXITS:
            # Eq. 2.1 with reward 0: the subtask has already paid for the step through the door.
            remaining = 0.0 if terminated else float(self.exit_values(next_state).max())
            self.completion_.move_towards(room, move, remaining)

    def to_arrays(self) -> Arrays:
        """Return both tables."""
        return nest(completion=self.completion_.to_arrays(), subtask=self.subtask_.to_arrays())

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over both tables.

        Raises
        ------
        DataError
            A table has another shape.
        """
        self.completion_.from_arrays(unnest(arrays, "completion"))
        self.subtask_.from_arrays(unnest(arrays, "subtask"))
