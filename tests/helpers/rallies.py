"""Things that move by known rules, with kinds that change at edges; for tests of concepts, events and world models."""

import numpy as np

from semrl.concepts import Concepts
from semrl.core import History, Trajectory
from semrl.core.things import no_things
from semrl.world_model import ConceptRules

BALL, PADDLE, CLIPPED, DIGIT = 0, 1, 2, 3


def thing(identity, kind, box, *, still=0, own=0, slot=-1):
    return [identity, kind, still, own, slot, *box]


def table(*rows):
    return np.array(rows, np.float32) if rows else no_things()


def rally(decisions, seed=0, bottom=70.0, paddle_px=12.0):
    """A ball flies between walls; an own paddle goes up and down and is cut off, and looks otherwise, at the bottom."""
    rng = np.random.default_rng(seed)
    x, y, vx, vy, top = 20.0, 30.0, 2.0, 1.0, 40.0
    tables, actions, rewards, identity = [], [], [], 1
    for _ in range(decisions):
        action = int(rng.integers(2)) if rng.random() < 0.5 else int(y > top + paddle_px / 2)
        low = min(top + paddle_px, bottom)
        kind = CLIPPED if low - top < paddle_px else PADDLE
        tables.append(
            table(
                thing(0, kind, (60, top, 62, low), own=1, slot=0),
                thing(identity, BALL, (x, y, x + 2, y + 2), slot=1),
                thing(10_000, DIGIT, (5, 0, 7, 4), still=1),
            )
        )
        reward = 0.0
        vy = -vy if (y + vy < 10 and vy < 0) or (y + 2 + vy > bottom and vy > 0) else vy
        vx = -vx if x <= 10 and vx < 0 else vx
        if vx > 0 and x + 2 < 60 <= x + 2 + vx and top - 2 <= y + vy <= top + paddle_px:
            vx = -vx
        if x >= 66:
            reward, x, y, vx, identity = -1.0, 20.0, float(rng.integers(20, 50)), 2.0, identity + 1
        else:
            x, y = x + vx, y + vy
        top = float(np.clip(top + (3 if action else -3), 10, bottom - 5))
        actions.append(action)
        rewards.append(reward)
    return tables, np.array(actions), np.array(rewards, np.float32)


def facts_of(things, slots=2):
    """The list of tracked objects: x, y and whether it is seen, of each slot."""
    facts = np.zeros((slots, 3), np.float32)
    for one in things:
        if one[4] >= 0:
            facts[int(one[4])] = (one[5] + one[7] - 1) / 166, (one[6] + one[8] - 1) / 166, 1
    return facts.ravel()


def trajectory_of(tables, actions, rewards):
    """An episode as the lower line learns it, but for the last decision."""
    return Trajectory(
        states=np.array([facts_of(things) for things in tables]),
        actions=actions[:-1],
        rewards=rewards[:-1],
        things=tuple(tables),
    )


def rules_of(episodes):
    """The rules about concepts that are read from episodes."""
    concepts = Concepts()
    rules = ConceptRules(concepts)
    for trajectory in episodes:
        concepts.partial_fit(trajectory.things)
        rules.partial_fit(trajectory)
    return rules


def history_of(trajectory, t, length=6):
    first = max(t - length + 1, 0)
    return History(
        states=trajectory.states[first : t + 1][::-1],
        actions=trajectory.actions[max(t - length, 0) : t][::-1],
        number=t,
        things=trajectory.things[first : t + 1][::-1],
    )
