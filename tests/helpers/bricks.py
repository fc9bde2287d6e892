"""A ball in a box, with rows of bricks that it takes away, each for a point; for tests of what stands still."""

import numpy as np
from rallies import BALL, thing

from semrl.core.things import GROUND, no_things

BRICKS, WALL = (0, 2), 1
"""Colours of the ground: of two rows of bricks, and of the walls."""

_WIDTH_PX, _TOPS_PX = 8.0, (20.0, 16.0)
_WALLS = (0, 0, 84, 8), (0, 8, 8, 84), (72, 8, 84, 84), (8, 76, 72, 84)


def bricks(decisions, seed=0, *, rows=2):
    """Return the things, the actions, which do nothing, and the rewards."""
    rng = np.random.default_rng(seed)
    there = np.ones((rows, 8), np.bool_)
    x, y, vx, vy = 20.0 + float(rng.integers(30)), 50.0, 2.0, -2.0
    tables, rewards = [], []
    for _ in range(decisions):
        ball = thing(0, BALL, (x, y, x + 2, y + 2), slot=0)
        walls = [_patch(WALL, box) for box in _WALLS]
        table = np.array([ball, *walls, *_runs(there)], np.float32).reshape(-1, no_things().shape[1])
        tables.append(table[np.argsort(table[:, 0], kind="stable")])
        reward = 0.0
        if not 8 <= x + vx <= 70:
            vx = -vx
        if y + 2 + vy > 76:
            vy = -vy
            vx = float(rng.choice([-2.0, 2.0]))
        elif y + vy < 8:
            vy = -vy
        else:
            for row, top in enumerate(_TOPS_PX[:rows]):
                column = int((x + 1 - 8) // _WIDTH_PX)
                if vy < 0 and y >= top + 4 > y + vy and there[row, column]:
                    there[row, column], vy, reward = False, -vy, 1.0
        if not there.any():
            there[:] = True
        x, y = x + vx, y + vy
        rewards.append(reward)
    return tables, np.zeros(decisions, np.int64), np.array(rewards, np.float32)


def _runs(there):
    """The bricks that are left, those beside each other as one piece."""
    for row, columns in enumerate(there):
        ends = np.flatnonzero(np.diff(np.concatenate([[0], columns, [0]])))
        for first, last in zip(ends[::2], ends[1::2], strict=True):
            top = _TOPS_PX[row]
            yield _patch(BRICKS[row], (8 + first * _WIDTH_PX, top, 8 + last * _WIDTH_PX, top + 4))


def _patch(colour, box):
    return thing(1_000_000 + 84 * box[1] + box[0], colour, box, still=GROUND)
