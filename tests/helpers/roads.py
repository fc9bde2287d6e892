"""A road for tests: what actions move crosses it, and cars, which go on for ever, set it back."""

import numpy as np
from rallies import BALL, DIGIT, PADDLE, table, thing

from semrl.core import Trajectory

CARS = ((20.0, 2.0), (36.0, -1.0), (50.0, 1.5))
"""Of each lane: where it is, and how fast its car goes."""

BACK_DECISIONS = 4


def road(decisions, seed=0, *, swaps=False):
    """A thing goes up and down, set back by cars; with `swaps`, the track of a car that left is another lane's."""
    rng = np.random.default_rng(seed)
    places = [float(rng.integers(5, 75)) for _ in CARS]
    top, back, tables, actions = 62.0, 0, [], []
    identities = list(range(1, len(CARS) + 1))
    for _ in range(decisions):
        tables.append(
            table(
                thing(0, PADDLE, (38, top, 42, top + 4), own=1, slot=0),
                *(
                    thing(identities[k], BALL, (x, y, x + 5, y + 4), slot=k + 1)
                    for k, (x, (y, _)) in enumerate(zip(places, CARS, strict=True))
                ),
                thing(10_000, DIGIT, (5, 0, 7, 4), still=1),
            )
        )
        action = 1 if rng.random() < 0.7 else 0
        hit = any(abs(x + 2.5 - 40) < 4.5 and abs(y - top) < 4 for x, (y, _) in zip(places, CARS, strict=True))
        back = BACK_DECISIONS if hit else max(back - 1, 0)
        top = float(np.clip(top + (2.0 if back or not action else -2.0), 10, 66))
        top = 66.0 if top <= 10 else top
        for k, (_, speed) in enumerate(CARS):
            places[k] += speed
            if not 0 <= places[k] <= 78:
                places[k] = 0.0 if speed > 0 else 78.0
                other = (k + 1) % len(CARS)
                if swaps:
                    identities[k], identities[other] = identities[other], identities[k]
                else:
                    identities[k] += len(CARS)
        actions.append(action)
    rewards = np.zeros(decisions, np.float32)
    states = np.array([_facts(things) for things in tables])
    return Trajectory(states=states, actions=np.array(actions[:-1]), rewards=rewards[:-1], things=tuple(tables))


def _facts(things):
    facts = np.zeros((len(CARS) + 1, 3), np.float32)
    for one in things:
        if one[4] >= 0:
            facts[int(one[4])] = (one[5] + one[7] - 1) / 166, (one[6] + one[8] - 1) / 166, 1
    return facts.ravel()
