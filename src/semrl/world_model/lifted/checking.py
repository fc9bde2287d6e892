"""Whether decision lists say what a world model predicts, and which of them is right, in play that is new to both."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semrl.concepts.scenes import PLACE, WIDTH, X
from semrl.core import Floats, Trajectory
from semrl.core.named import IMAGE_SIZE_PX
from semrl.core.things import SLOT_NUMBERS
from semrl.world_model.lifted.decision_lists import DecisionList
from semrl.world_model.lifted.events import agree
from semrl.world_model.lifted.play import LATER_VX, Play
from semrl.world_model.lifted.samples import LATER_ACTION, LATER_REWARD, REWARD_COLUMN, Samples, samples_of

AHEAD = 2
"""Decisions within which turns and rewards of lists come."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictedEpisode:
    """An episode, and what a world model predicted at each of its decisions, given what was done then."""

    trajectory: Trajectory
    states: Floats
    """``(t, 2, d)`` float32, one and two decisions ahead."""
    rewards: Floats
    """``(t, 2)`` float32."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Check:
    """How a list did in new play."""

    about: str
    rules: int
    """How many rules the list has; checks come in the order of the lists."""
    decisions: int
    """In which it had something to say, each thing of the concept for itself."""
    agreed: int
    """Those in which it said what the world model predicted."""
    right: int
    world_model_right: int
    """Those in which it, and the world model, said what came."""
    came: int
    """Those in which anything else came at once than "otherwise"; 0 where a list has none."""
    right_of_came: int
    world_model_right_of_came: int
    """Those of them in which it, and the world model, said so."""

    def __str__(self) -> str:
        """Say it in one line."""
        if not self.decisions:
            return "in new play nothing that it is about was seen"
        agreed, right, other = (
            round(100 * part / self.decisions) for part in (self.agreed, self.right, self.world_model_right)
        )
        text = f"agrees with the world model in {agreed} of 100 new decisions, is right in {right} (that in {other})"
        if self.came:
            text += f"; of {self.came:,} that came it says {self.right_of_came:,} ({self.world_model_right_of_came:,})"
        return text


def check_list(one: DecisionList, play: Play, objects: Floats, episodes: Sequence[PredictedEpisode]) -> Check:
    """Compare a list with what came in some play, of which the objects are given, and with what was predicted."""
    about = one.vocabulary.about
    samples = samples_of(play, objects, about.concept, about.kinds)
    said = one.says(samples.rows)
    came = one.came(samples.rows, samples.targets)
    predicted = one.came(samples.rows, predicted_targets(samples, objects, episodes))
    known = ~np.isnan(came) & ~np.isnan(predicted)
    said, came, predicted = said[known], came[known], predicted[known]
    right, world_model_right = agree(said, came), agree(predicted, came)
    at_once = (np.abs(came) == 1) & bool(one.codes)
    return Check(
        about=one.about,
        rules=len(one.rules),
        decisions=len(said),
        agreed=int(agree(said, predicted).sum()),
        right=int(right.sum()),
        world_model_right=int(world_model_right.sum()),
        came=int(at_once.sum()),
        right_of_came=int(right[at_once].sum()),
        world_model_right_of_came=int(world_model_right[at_once].sum()),
    )


def predicted_targets(samples: Samples, objects: Floats, episodes: Sequence[PredictedEpisode]) -> Floats:
    """Return as targets what was predicted: velocities and the reward; not a number what was not, or of other things.

    What is predicted is where the things of slots are: of some that share a slot, those of which the facts are not have
    no prediction.
    """
    targets = np.full_like(samples.targets, np.nan)
    states = np.concatenate([_padded(one.trajectory.states[:, None], one.states) for one in episodes])
    rewards = np.concatenate([np.append(np.sign(np.rint(one.rewards)), [[np.nan] * AHEAD], axis=0) for one in episodes])
    things = objects[samples.things]
    slots = things[:, PLACE].astype(np.int64)
    listed = slots >= 0
    for axis in range(2):
        places = states[samples.decisions, :, np.where(listed, slots, 0) * SLOT_NUMBERS + axis] * (IMAGE_SIZE_PX - 1)
        off = np.abs(places[:, 0] + 0.5 - things[:, X + axis])
        places[~listed | (off > things[:, WIDTH + axis] / 2)] = np.nan
        targets[:, axis] = places[:, 1] - places[:, 0]
        targets[:, LATER_VX + axis] = places[:, 2] - places[:, 1]
    targets[:, [REWARD_COLUMN, LATER_REWARD]] = rewards[samples.decisions]
    targets[:, LATER_ACTION] = samples.targets[:, LATER_ACTION]
    return targets


def _padded(now: Floats, predicted: Floats) -> Floats:
    """Join ``(t + 1, 1, d)`` states with what was predicted at all but the last of them, ``(t + 1, 3, d)``."""
    ends = np.full((1, *predicted.shape[1:]), np.nan, np.float32)
    return np.concatenate([now, np.concatenate([predicted, ends])], axis=1)
