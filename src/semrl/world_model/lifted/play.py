"""The play that a lifted world model learns from: what was seen, done and gained, episode after episode."""

import numpy as np

from semrl.concepts import Concepts, SceneBuilder
from semrl.concepts.scenes import CONCEPT, IDENTITY, PLACE, X, Y
from semrl.core import NO_ACTION, Floats, Ints, Trajectory
from semrl.core.arrays import Arrays
from semrl.core.kernels import compiled
from semrl.core.things import no_things
from semrl.world_model.experience import discounted
from semrl.world_model.lifted.features import PAST_ACTIONS, Kinds, describe, width

TARGETS = ("vx", "vy", "vanishes", "reward", "return", "entry x", "entry y", "absence")
"""What is predicted of a thing: its next velocity, whether it is gone then, the reward now, and the return from now; of
what vanishes, where its successor comes in, the next thing with its slot, and after how many decisions.

Behind them stands the velocity after the next one: what turns between two decisions has turned by then."""

ENTRY = 5
"""Place of the first target about successors."""

LATER_VX = len(TARGETS)
"""Column of the velocity after the next one."""

LONGEST_ABSENCE = 10
"""Decisions: what comes in later is no successor."""

_END = -1  # stands for the action after the last state of an episode


class Play:
    """The newest episodes, state by state.

    Parameters
    ----------
    capacity
        States kept; whole episodes go, oldest first, but the newest always stays.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.things: Floats = no_things()
        self.sizes: Ints = np.zeros(0, np.int64)
        self.actions: Ints = np.zeros(0, np.int64)
        self.rewards: Floats = np.zeros(0, np.float32)

    def __len__(self) -> int:
        """How many states are kept."""
        return len(self.sizes)

    def add(self, trajectory: Trajectory) -> None:
        """Remember an episode."""
        self.things = np.concatenate([self.things, *trajectory.things])
        self.sizes = np.append(self.sizes, [len(seen) for seen in trajectory.things]).astype(np.int64)
        self.actions = np.append(self.actions, [*trajectory.actions, _END]).astype(np.int64)
        self.rewards = np.append(self.rewards, [*trajectory.rewards, 0]).astype(np.float32)
        ends = np.flatnonzero(self.actions == _END)
        while len(self) > self.capacity and len(ends) > 1:
            first, ends = ends[0] + 1, ends[1:] - ends[0] - 1
            self.things = self.things[self.sizes[:first].sum() :]
            self.sizes, self.actions, self.rewards = self.sizes[first:], self.actions[first:], self.rewards[first:]

    def joined(self, trajectory: Trajectory) -> "Play":
        """Return all that is remembered and one more episode; this one stays as it is."""
        more = Play(self.capacity)
        more.from_arrays(self.to_arrays())
        more.add(trajectory)
        return more

    def objects(self, concepts: Concepts) -> Floats:
        """Return all things as objects, ``(n, 14)``; see `SceneBuilder.objects`."""
        fresh = np.append(1, self.actions[:-1] == _END).astype(np.int64)
        return SceneBuilder(concepts).objects(self.things, np.cumsum(self.sizes), fresh)

    def rows(self, objects: Floats, concept: int, kinds: Kinds, discount: float) -> tuple[Floats, Floats]:
        """Return what is asked of each thing of a concept, ``(n, f)``, and `TARGETS`, ``(n, 10)``.

        Also of what is seen for the first time: how it was served shows in its place.
        The next velocity of what is gone is not a number, nor are place and time of a successor that never comes.
        """
        signs = np.sign(self.rewards).astype(np.float32)
        returns = discounted(signs, self.actions == _END, discount)
        relations = int(kinds.relation_of.max(initial=-1)) + 1
        gains = np.column_stack([signs, returns]).astype(np.float32)
        return _rows(objects, np.cumsum(self.sizes), (self.actions, gains), concept, kinds, relations)

    def to_arrays(self) -> Arrays:
        """Return all that is remembered."""
        return {"things": self.things, "sizes": self.sizes, "actions": self.actions, "rewards": self.rewards}

    def from_arrays(self, arrays: Arrays) -> None:
        """Take over what `to_arrays` returned."""
        self.things, self.sizes = arrays["things"], arrays["sizes"]
        self.actions, self.rewards = arrays["actions"], arrays["rewards"]


@compiled
def _rows(  # noqa: PLR0917 - compiled functions take no keywords
    objects: Floats, ends: Ints, done: tuple[Ints, Floats], concept: int, kinds: Kinds, relations: int
) -> tuple[Floats, Floats]:
    """Describe every thing of a concept at every decision, and what came of it."""
    actions, gains = done
    n = 0
    for i in range(len(objects)):
        n += objects[i, CONCEPT] == concept
    rows, targets = np.empty((n, width(relations)), np.float32), np.full((n, LATER_VX + 2), np.nan, np.float32)
    now = np.empty(PAST_ACTIONS + 1, np.float32)
    n, begin, since = 0, 0, 0
    for t in range(len(ends) - 1):
        end, after = ends[t], ends[t + 1]
        if actions[t] >= 0:
            for k in range(PAST_ACTIONS + 1):
                now[k] = actions[t - k] if k <= since else NO_ACTION
            for i in range(begin, end):
                if objects[i, CONCEPT] != concept:
                    continue
                describe(objects[begin:end], i - begin, now, kinds, rows[n])
                last = ends[t + 2] if t + 2 < len(ends) and actions[t + 1] >= 0 else after
                _what_came(objects[i], objects[end:after], objects[after:last], targets[n])
                targets[n, 3:5] = gains[t]
                if targets[n, 2] and objects[i, PLACE] >= 0:
                    _who_follows(objects, i, (ends, actions), t, targets[n])
                n += 1
        since = since + 1 if actions[t] >= 0 else 0
        begin = end
    return rows[:n], targets[:n]


@compiled
def _what_came(one: Floats, following: Floats, later: Floats, target: Floats) -> None:
    """Write the next velocity of an object, whether it is gone, and the velocity after the next one."""
    target[2] = 1
    for j in range(len(following)):
        if following[j, IDENTITY] == one[IDENTITY] and following[j, CONCEPT] >= 0:
            target[0], target[1] = following[j, X] - one[X], following[j, Y] - one[Y]
            target[2] = 0
            for k in range(len(later)):
                if later[k, IDENTITY] == one[IDENTITY] and later[k, CONCEPT] >= 0:
                    target[LATER_VX] = later[k, X] - following[j, X]
                    target[LATER_VX + 1] = later[k, Y] - following[j, Y]


@compiled
def _who_follows(objects: Floats, i: int, when: tuple[Ints, Ints], t: int, target: Floats) -> None:
    """Write where the next thing with the slot of one that vanishes comes in, and after how many decisions."""
    ends, actions = when
    for later in range(1, LONGEST_ABSENCE + 1):
        if t + later >= len(ends) or actions[t + later - 1] < 0:
            return
        for j in range(ends[t + later - 1], ends[t + later]):
            if objects[j, PLACE] == objects[i, PLACE] and objects[j, CONCEPT] >= 0:
                target[ENTRY], target[ENTRY + 1], target[ENTRY + 2] = objects[j, X], objects[j, Y], later
                return
