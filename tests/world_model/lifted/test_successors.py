"""What leaves on one side and comes in on the other is predicted to do so, where and when; else it is gone."""

import numpy as np
import pytest
from rallies import BALL, facts_of, history_of, table, thing

from semrl.core import Trajectory
from semrl.world_model import LiftedConfig, LiftedWorld

CONFIG = LiftedConfig(members=2, screening=0, first_decisions=200)
LANES = {0: (20.0, 2.0), 1: (40.0, -3.0)}
AWAY = 3


def traffic(decisions, seed, *, comes_back=True):
    """Cars on two lanes, which leave and come in on the other side after some decisions; or anywhere, at any time."""
    rng = np.random.default_rng(seed)
    places = {lane: 10.0 + float(rng.integers(50)) for lane in LANES}
    away, identity, tables = dict.fromkeys(LANES, 0), {0: 0, 1: 1}, []
    for _ in range(decisions):
        rows = []
        for lane, (y, v) in LANES.items():
            if away[lane]:
                away[lane] -= 1
                continue
            x = places[lane]
            rows.append(thing(identity[lane], BALL, (x, y, x + 4, y + 4), slot=lane))
            places[lane] += v
            if not 0 <= places[lane] <= 80:
                places[lane] = (4.0 if v > 0 else 76.0) if comes_back else float(rng.integers(10, 70))
                away[lane] = AWAY if comes_back else int(rng.integers(1, 10))
                identity[lane] += 2
        tables.append(table(*rows))
    return tables


def played(tables):
    """The same as an episode in which nothing is done and nothing gained."""
    n = len(tables) - 1
    return Trajectory(
        states=np.array([facts_of(things) for things in tables]),
        actions=np.zeros(n, np.int64),
        rewards=np.zeros(n, np.float32),
        things=tuple(tables),
    )


def learned(**of):
    world = LiftedWorld(CONFIG, 6, seed=1)
    world.partial_fit(played(traffic(900, 0, **of)))
    return world


@pytest.mark.parametrize("lane", LANES)
def test_cars_come_in_again_where_and_when_they_do(lane):
    world, play = learned(), played(traffic(400, 5))
    seen, right = 0, 0
    for t in range(6, 370):
        there = play.states[t : t + 13, 3 * lane + 2]
        if there[0] and not there.all() and there[-1]:
            told = world.imagine(history_of(play, t), play.actions[None, t : t + 12]).states[0]
            seen += 1
            same = (told[:, 3 * lane + 2] == there[1:]).mean() > 0.8
            right += same and 83 * abs(told[-1, 3 * lane] - play.states[t + 12, 3 * lane]) < 4
    assert seen > 20 and right > 0.8 * seen


def test_who_comes_in_anywhere_is_not_foretold():
    world, play = learned(comes_back=False), played(traffic(400, 5, comes_back=False))
    for t in range(6, 370):
        if play.states[t, 2] and not play.states[t + 1, 2]:
            told = world.imagine(history_of(play, t), play.actions[None, t : t + 12]).states[0]
            assert not told[-1, 2]
